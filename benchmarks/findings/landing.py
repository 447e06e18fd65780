"""A tool that comes down on a board while somebody pushes the arm, with a wrench sensor and without."""

import math
from dataclasses import dataclass, replace

import numpy as np
from benchmarks.findings.models import ARM, SAFE, VICES
from benchmarks.findings.printing import say, spreads

import contactsafe as cs
from contactsafe.experiments.collision_motions import sample_motion, scene_rng
from contactsafe.experiments.motions import Playback, record_rest
from contactsafe.experiments.push_scenes import (
    FORCE_N,
    RAMP_S,
    PushedMotion,
    inclined,
    sample_angle,
    sample_touchable_point,
)
from contactsafe.robot.arm import Pose
from contactsafe.robot.ik import solve_ik
from contactsafe.sim.config import REAL_SENSORS, WorldConfig
from contactsafe.sim.worlds import Worlds

ABOVE_M, INTO_M = 0.04, 0.004
"""Where the tool begins above the board, and how far below its surface x_d ends."""

SCENES = 64


@dataclass(frozen=True)
class Landing(PushedMotion):
    """A tool that comes straight down, some time between 0.2 s after a push began and 2.6 s after that.

    Attributes:
        lands_s: when x_d is at the surface, s.
    """

    lands_s: float

    @property
    def meets_s(self) -> float:
        """When the push begins, s."""
        return 1.0

    def target(self, time_s: float) -> np.ndarray:
        """Return where x_d is, (3,), m."""
        down = ABOVE_M + (time_s - self.lands_s) * self.speed_m_s
        return self.start.position - np.array([0.0, 0.0, min(max(down, 0.0), ABOVE_M + INTO_M)])


def landing(seed: int) -> Landing:
    """Sample a place on the board, a push, and when the tool lands."""
    rng, motion, q = scene_rng(seed, 7), sample_motion(ARM, seed, slides=True, holds=True), np.empty(ARM.n)
    nominal = ARM.nominal()
    start = Pose(motion.start.position + np.array([0.0, 0.0, ABOVE_M + INTO_M]), motion.start.quat)
    solve_ik(nominal.handle, start.position, start.quat, motion.q_start.copy(), ARM.q_min, ARM.q_max, q)
    force_n, ramp_s, angle = rng.uniform(*FORCE_N), math.exp(rng.uniform(*np.log(RAMP_S))), sample_angle(rng)
    link, point, inwards = sample_touchable_point(ARM, q, rng)
    known = {name: getattr(motion, name) for name in type(motion).__dataclass_fields__}
    known |= {
        "start": start,
        "q_start": q,
        "lands_s": 1.6 + rng.uniform(-0.8, 2.0),
        "speed_m_s": rng.uniform(0.05, 0.2),
    }
    push = force_n * inclined(inwards, angle, rng)
    return Landing(**known, link=link, point=point, force=push, ramp_s=ramp_s, angle_rad=angle)


def pressed_n(scenes: list[Landing], config: cs.ControllerConfig, with_sensor: bool) -> list[float]:
    """Return the largest force on each tool, as a mean of 50 ms."""
    sensors, largest = replace(REAL_SENSORS, wrist=with_sensor), []
    for batch in (scenes[start : start + 16] for start in range(0, len(scenes), 16)):
        worlds = Worlds(ARM, [WorldConfig(scene.plant, sensors) for scene in batch], config, len(batch), 0)
        play = Playback(worlds, batch)
        for i, scene in enumerate(batch):
            worlds.push(i, f"link{scene.link}", scene.point, scene.force, scene.meets_s, scene.release_s, scene.ramp_s)
        for trace in record_rest(play):
            force = np.linalg.norm(trace["tool_force"], axis=1)
            largest.append(float(np.convolve(force, np.full(50, 0.02), "valid").max()))
        worlds.close()
    return largest


def tool_that_lands_under_a_push() -> None:
    """What meets a tool while somebody pushes the arm is not a part of the push, sensor or not."""
    scenes = [landing(seed) for seed in range(SCENES)]
    for name, config in (("vices", VICES), ("safe", SAFE)):
        for with_sensor in (True, False):
            sensor = "with" if with_sensor else "without"
            force = pressed_n(scenes, config, with_sensor)
            say(f"{name + ', ' + sensor + ' a wrench sensor':32s} {SCENES} landings: tool {spreads(force, 'N')}")
