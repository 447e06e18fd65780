"""Contacts that stay at their point of the arm while it is still and while it moves, and what its sensors say of them.

The arm is driven by a stiff impedance controller that is blind to contact, as somebody else's would be; the force
turns with the link, as that of a hand that holds it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contactsafe.control import presets
from contactsafe.experiments.collision_motions import Motion, sample_motion, scene_rng
from contactsafe.experiments.onsets import point_torque, pushed_links
from contactsafe.experiments.push_scenes import inclined, sample_touchable_point
from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.ik import solve_ik
from contactsafe.robot.shape import link_frames
from contactsafe.sim.config import FRANKA_SENSORS, SensorConfig, WorldConfig
from contactsafe.sim.worlds import Worlds

FORCE_N = (10.0, 60.0)
"""Log-uniform."""

STILL, MOVED = "still", "moved"
REST_MS, STILL_MS, MOVED_MS = 600, 1100, 2300
"""The contact begins; what is known of it is looked at while the arm is still; and once it has moved."""

PATH_M = (0.1, 0.15)
"""How far the tool is moved in contact, uniform."""

REAL_SENSORS = replace(FRANKA_SENSORS, base=True)
"""A Franka's, and a sensor under its base, which an estimator is told of or not."""

QUIET_SENSORS = SensorConfig(
    q_rad=0.0, qd_rad_s=0.0, encoder_step_rad=1e-6, joint_torque=True, joint_torque_nm=0.01, joint_torque_bias_nm=0.0,
    base=True, base_force_n=0.1, base_moment_nm=0.01, base_force_bias_n=0.0, base_moment_bias_nm=0.0,
)  # fmt: skip
"""Sensors that are better than any arm has."""

_STIFFNESS = np.full(6, 600.0)  # 1/s²: some 2 kN/m
_MOVE_MS = 1000  # the target takes this long, and then waits
_FRICTION = 0.5  # force across the normal, at most
_RAMP_MS = (20.0, 200.0)  # log-uniform
_PRESSED_EVERY_MS = 10  # the force is turned with its link so often


@dataclass(frozen=True)
class Touch:
    """One contact.

    Attributes:
        link: that is touched, 3 … n.
        point: on its surface, in its frame, (3,), m.
        inwards: normal of the surface there, in its frame, (3,).
        force: in its frame, (3,), N.
    """

    link: int
    point: np.ndarray
    inwards: np.ndarray
    force: np.ndarray

    def in_world(self, origins: np.ndarray, rotations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return point and force in world axes, from the frames of `link_frames` in one posture."""
        R = rotations[self.link]
        return origins[self.link] + R @ self.point, R @ self.force


@dataclass(frozen=True)
class TouchScene:
    """A motion of which the beginning is followed in contact, and one contact or two.

    Attributes:
        motion: where the tool is and where it goes.
        path_m: how far.
        ramp_ms: time from nothing to full force.
        touches: on different links.
    """

    motion: Motion
    path_m: float
    ramp_ms: float
    touches: tuple[Touch, ...]

    def target(self, tick: int) -> np.ndarray:
        """Return where the tool is to be, (3,), m."""
        fraction = min(max((tick - STILL_MS) / _MOVE_MS, 0.0), 1.0)
        smooth = fraction * fraction * (3.0 - 2.0 * fraction)
        return self.motion.start.position + smooth * self.path_m / self.motion.length_m * self.motion.path

    def pressed(self, tick: int) -> float:
        """Return the fraction of the force that is on at a tick."""
        return min(max((tick - REST_MS) / self.ramp_ms, 0.0), 1.0)


@dataclass(frozen=True)
class Sensed:
    """What the sensors said, a row a ms, and the truth.

    Attributes:
        q, qd, torque: measured, (T, n), rad, rad/s, N m.
        q_true: (T, n), rad.
        wrench_base: measured, as of `Measurement`, (T, 6), N and N m.
    """

    q: np.ndarray
    qd: np.ndarray
    torque: np.ndarray
    q_true: np.ndarray
    wrench_base: np.ndarray


def sample_touch_scene(arm: Arm, seed: int, contacts: int) -> TouchScene:
    """Sample where and how hard an arm is touched; it depends on arm and seed alone.

    Args:
        arm: built from a description.
        seed: of the scene.
        contacts: 1, or 2 on different links; the first is the same in both.

    Raises:
        UnreachableError: the arm reaches no motion.
    """
    motion, rng = sample_motion(arm, seed, slides=False, holds=False), scene_rng(seed, 5)
    path_m, ramp_ms = rng.uniform(*PATH_M), math.exp(rng.uniform(*np.log(_RAMP_MS)))
    rotations = link_frames(description_and_tool(arm)[0], motion.q_start[None])[1][0]
    touches: list[Touch] = []
    while len(touches) < contacts:
        free = tuple(link for link in pushed_links(arm) if all(link != touch.link for touch in touches))
        link, point, inwards = sample_touchable_point(arm, motion.q_start, rng, free)
        force_n, angle = math.exp(rng.uniform(*np.log(FORCE_N))), math.atan(rng.uniform(0.0, _FRICTION))
        force = force_n * inclined(inwards, angle, rng)
        touches.append(Touch(link, point, rotations[link].T @ inwards, rotations[link].T @ force))
    return TouchScene(motion, path_m, ramp_ms, tuple(touches))


def sense(arm: Arm, scenes: Sequence[TouchScene], real: bool) -> list[Sensed]:
    """Play scenes side by side, each in a world of its own, and record what the sensors say.

    Args:
        arm: that is touched.
        scenes: one for each world.
        real: with errors of plant and sensors; otherwise an arm just as its model, with `QUIET_SENSORS`.
    """
    configs = [
        WorldConfig(scene.motion.plant, REAL_SENSORS, fixtures=())
        if real
        else WorldConfig(sensors=QUIET_SENSORS, fixtures=())
        for scene in scenes
    ]
    worlds = Worlds(arm, configs, presets.vices(), len(scenes), [scene.motion.seed for scene in scenes])
    for i, scene in enumerate(scenes):
        worlds.reset(i, scene.motion.q_start, _STIFFNESS)
    target, nominal = worlds.controllers["target"], arm.nominal()
    target["quat"] = [scene.motion.start.quat for scene in scenes]
    seen, rows = worlds.controllers["measurement"], np.zeros((4, MOVED_MS, len(scenes), arm.n))
    at_base = np.zeros((MOVED_MS, len(scenes), 6))
    one_tick = np.ones(len(scenes), dtype=np.int64)
    for tick in range(MOVED_MS):
        if tick % _PRESSED_EVERY_MS == 0:
            for i, scene in enumerate(scenes):
                target["position"][i], q = scene.target(tick), np.empty(arm.n)
                solve_ik(
                    nominal.handle, target["position"][i], target["quat"][i], target["q_posture"][i],
                    arm.q_min, arm.q_max, q,
                )  # fmt: skip
                target["q_posture"][i] = q
                _press(worlds, i, scene, tick)
        worlds.run_some(0, len(scenes), one_tick)  # so short a run is not worth threads
        rows[:, tick] = seen["q"], seen["qd"], seen["torque"], worlds.records["truth"]["q"]
        at_base[tick] = seen["wrench_base"]
    worlds.close()
    return [Sensed(*(row[:, i] for row in (*rows, at_base))) for i in range(len(scenes))]


def _press(worlds: Worlds, i: int, scene: TouchScene, tick: int) -> None:
    """Put the forces of a scene on the links of its world as they are now."""
    model, data = worlds.models[i], worlds.datas[i]
    data.xfrc_applied[:] = 0.0
    for touch in scene.touches:
        body = model.body(f"link{touch.link}").id
        R = data.xmat[body].reshape(3, 3)
        force = scene.pressed(tick) * R @ touch.force
        data.xfrc_applied[body, :3] += force
        data.xfrc_applied[body, 3:] += np.cross(data.xpos[body] + R @ touch.point - data.xipos[body], force)


def true_torque(arm: Arm, scene: TouchScene, q: np.ndarray) -> np.ndarray:
    """Return what the contacts of a scene put on the joints, (n,), N m, at q (n,) rad, with their full force."""
    origins, rotations = (frames[0] for frames in link_frames(description_and_tool(arm)[0], q[None]))
    return sum(
        (point_torque(origins, rotations, t.link, *t.in_world(origins, rotations)) for t in scene.touches),
        start=np.zeros(arm.n),
    )


def true_base_wrench(arm: Arm, scene: TouchScene, q: np.ndarray) -> np.ndarray:
    """Return the wrench of the contacts of a scene about the world's origin, (6,), N and N m, at q (n,) rad."""
    origins, rotations = (frames[0] for frames in link_frames(description_and_tool(arm)[0], q[None]))
    places = [touch.in_world(origins, rotations) for touch in scene.touches]
    return sum((np.concatenate([force, np.cross(point, force)]) for point, force in places), start=np.zeros(6))
