"""Scenes of the findings: arms that hold still, a plain MuJoCo loop, random motions and what is in their path."""

import math
from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from benchmarks.findings.models import ARM, VICES

import contactsafe as cs
from contactsafe.experiments.collision_motions import sample_motion
from contactsafe.experiments.collision_scenes import sample_meetings
from contactsafe.experiments.franka_links import PUSH_POINTS
from contactsafe.experiments.motions import record
from contactsafe.sim.config import NO_NOISE, REAL_SENSORS, WorldConfig
from contactsafe.sim.obstacles import Obstacle
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import Worlds

STIFFNESS = np.array([150.0] * 3 + [450.0] * 3)
PUSH_N = 25.0
UNTOUCHED = np.zeros(6)
"""What a force sensor measures while nothing touches the tool."""


def hold(
    config: cs.ControllerConfig,
    seconds: float,
    pushes: Sequence[tuple[int, Sequence[float]]] = ((0, ()),),
    obstacles: tuple[Obstacle, ...] = (),
) -> np.ndarray:
    """Let arms as modelled hold the tool at home, each pushed on one link from 0.2 s on; traces, (worlds, T)."""
    worlds = Worlds(ARM, WorldConfig(sensors=NO_NOISE, obstacles=obstacles), config, len(pushes), 0)
    for i, (link, force) in enumerate(pushes):
        worlds.reset(i, ARM.home, STIFFNESS)
        if link:
            worlds.push(i, f"link{link}", PUSH_POINTS[link], force, 0.2, seconds)
    step = np.zeros((worlds.n, 10), dtype=trace_dtype(ARM.n))
    pieces = []
    for _ in range(round(100 * seconds)):
        worlds.run(10, step)
        pieces.append(step.copy())
    worlds.close()
    return np.concatenate(pieces, axis=1)


def lasting_pushes() -> list[tuple[int, Sequence[float]]]:
    """Return horizontal pushes of 25 N from four sides on links 4, 5 and 6."""
    sides = [(math.cos(a), math.sin(a), 0.0) for a in np.arange(4) * math.pi / 2 + 0.4]
    return [(link, PUSH_N * np.array(side)) for link in PUSH_POINTS for side in sides]


def strays_mm(traces: np.ndarray) -> np.ndarray:
    """Return how far each tool went from where it was at first, mm."""
    return 1000.0 * np.linalg.norm(traces["position"] - traces["position"][:, :1], axis=2).max(axis=1)


class Loop:
    """A controller under a plain MuJoCo loop, the arm without friction; what pushes it is written into `data`.

    Args:
        config: of the controller.
        arm: whose model is the plant.
        q: where it starts and what it holds, (n,), rad.
        wrench_ee: what the force sensor says; None for no sensor.
    """

    def __init__(self, config: cs.ControllerConfig, arm: cs.Arm = ARM, q=ARM.home, wrench_ee=UNTOUCHED):
        self.model, self.data = arm.model, mujoco.MjData(arm.model)
        self.data.qpos[:] = q
        self.wrench_ee = wrench_ee
        mujoco.mj_forward(self.model, self.data)
        self.controller = cs.Controller(arm, config.with_(friction_compensation=False))
        self.controller.reset(q)
        self.target = cs.Target(arm.tool_pose(q), STIFFNESS, posture=q)

    def tick(self, torque: Callable[[cs.Output], np.ndarray] = lambda out: out.torque) -> cs.Output:
        """Run one millisecond; `torque` may change what is sent."""
        out = self.controller.step(cs.Measurement(self.data.qpos, self.data.qvel, self.wrench_ee), self.target)
        sent = torque(out)
        self.controller.record["state"]["command"]["tau"] = sent  # the observer has to know
        self.data.ctrl[:] = sent
        mujoco.mj_step(self.model, self.data)
        return out

    def push(self, body: str, force: Sequence[float]) -> None:
        """Push a body at its centre of mass with a force in world axes, N, from now on."""
        self.data.xfrc_applied[self.model.body(body).id, :3] = force

    def push_torque(self) -> np.ndarray:
        """Return the joint torque of what pushes, Jᵀ F, (n,), N m."""
        mujoco.mj_forward(self.model, self.data)
        torque, J = np.zeros(self.model.nv), np.zeros((3, self.model.nv))
        for body in range(1, self.model.nbody):
            mujoco.mj_jacBodyCom(self.model, self.data, J, None, body)
            torque += J.T @ self.data.xfrc_applied[body, :3]
        return torque


class Scenes:
    """Random motions and what the arm meets on them, as in `contactsafe experiment collisions`.

    Args:
        wanted: how many.
        sweeps_only: leave out those in which the tool holds still.
    """

    def __init__(self, wanted: int, sweeps_only: bool = False):
        self.motions = []
        seed = 0
        while len(self.motions) < wanted:
            motion = sample_motion(ARM, seed)
            if not (sweeps_only and motion.holds):
                self.motions.append(motion)
            seed += 1
        self.seeds = [motion.seed for motion in self.motions]
        worlds = Worlds(ARM, [motion.world((), REAL_SENSORS) for motion in self.motions], VICES, wanted, self.seeds)
        self.free = record(worlds, self.motions)
        worlds.close()
        self.obstacles = [
            tuple(meeting.obstacle for meeting in sample_meetings(ARM, motion, trace["q"]))
            for motion, trace in zip(self.motions, self.free, strict=True)
        ]

    def run(self, config: cs.ControllerConfig, worlds: Sequence[WorldConfig], kind: type[Worlds] = Worlds) -> list:
        """Play the motions under a controller; traces, one a scene."""
        stepped = kind(ARM, worlds, config, len(self.motions), self.seeds)
        traces = record(stepped, self.motions)
        stepped.close()
        return traces
