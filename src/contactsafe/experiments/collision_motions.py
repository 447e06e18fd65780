"""Random motions for collisions: what the tool is asked to do, and how the plant differs from its model.

A motion depends on the seed of its scene alone.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contactsafe.core.errors import UnreachableError
from contactsafe.core.rotation import quat_multiply, rotvec_to_quat
from contactsafe.policy.action import DOWN
from contactsafe.robot.arm import Arm, Pose
from contactsafe.robot.ik import POSITION_TOLERANCE, solve_ik
from contactsafe.sim.config import PlantConfig, SensorConfig, WorldConfig
from contactsafe.sim.fixtures import workbench
from contactsafe.sim.obstacles import Obstacle
from contactsafe.tasks.base.evaluation import HELD_OUT_SEED

TARGET_OFFSET_MAX_M = 0.05
"""Largest distance of a policy's x_d from the tool, m."""

SURFACE_CENTRE = workbench().position
"""Of the level surface that the tool slides on, world, m."""

AFTER_S = 2.5
"""How long a trial goes on after the arm would reach the obstacle, s."""

_PRESS_M = 0.004  # depth of x_d below the surface that the tool slides on

_TRIES = 2000

_MARGIN_RAD = 0.15  # of the joint range, kept free along the path


@dataclass(frozen=True)
class Motion:
    """What the tool is asked to do.

    Attributes:
        seed: of the scene.
        slides: pressed on the table's surface; otherwise in free air.
        start: tool pose at first.
        path: from start to end, world, m; zeros to hold.
        speed_m_s: of x_d along it.
        limited: x_d stays within `TARGET_OFFSET_MAX_M` of the tool, as a policy's does.
        stiffness: K1, (6,), 1/s².
        q_start: joint positions, (n,), rad.
        meets_at: fraction of the path at which the obstacle is met.
        plant: how the arm differs from its model.
    """

    seed: int
    slides: bool
    start: Pose
    path: np.ndarray
    speed_m_s: float
    limited: bool
    stiffness: np.ndarray
    q_start: np.ndarray
    meets_at: float
    plant: PlantConfig

    @cached_property
    def length_m(self) -> float:
        """Length of the path, m."""
        return float(np.linalg.norm(self.path))

    @cached_property
    def holds(self) -> bool:
        """Whether the tool is to stay where it is."""
        return not self.path.any()

    @property
    def meets_s(self) -> float:
        """When the obstacle is met, s."""
        return 0.6 if self.holds else 0.2 + self.meets_at * self.length_m / self.speed_m_s

    @property
    def duration_s(self) -> float:
        """How long the trial lasts, s."""
        return self.meets_s + AFTER_S

    def target(self, time_s: float) -> np.ndarray:
        """Return where on its path x_d is, (3,), m; it sets off after 0.2 s."""
        if self.holds:
            return self.start.position
        fraction = min(max((time_s - 0.2) * self.speed_m_s / self.length_m, 0.0), 1.0)
        return self.start.position + fraction * self.path

    def world(self, obstacles: tuple[Obstacle, ...], sensors: SensorConfig | None) -> WorldConfig:
        """Return the world to run it in, with its plant and these sensors; None for both as the controller believes."""
        if sensors is not None:
            return WorldConfig(plant=self.plant, sensors=sensors, obstacles=obstacles)
        return WorldConfig(obstacles=obstacles)


def scene_rng(seed: int, part: int) -> np.random.Generator:
    """Return the generator of one part of a scene: 0 its motion, 1 its obstacles."""
    return np.random.default_rng([HELD_OUT_SEED, seed, part])


def sample_plant(rng: np.random.Generator, n: int) -> PlantConfig:
    """Sample a plant that differs from its model: friction ± 20 % a joint, inertia ± 10 % a link, payload ± 0.2 kg."""
    return PlantConfig(
        friction_scale=tuple(rng.uniform(0.8, 1.2, n).tolist()),
        inertia_scale=tuple(rng.uniform(0.9, 1.1, n).tolist()),
        payload_kg=float(rng.uniform(-0.2, 0.2)),
        torque_delay_ticks=1,
    )


def sample_motion(arm: Arm, seed: int, slides: bool | None = None, holds: bool | None = None) -> Motion:
    """Sample what the tool does: a sweep of 20 to 45 cm at 0.1 to 0.5 m/s or a hold, in free air or sliding.

    Args:
        arm: that moves.
        seed: of the scene.
        slides, holds: None to sample them as well.

    Raises:
        UnreachableError: the arm reaches none.
    """
    rng = scene_rng(seed, 0)
    sliding, at_rest, limited = rng.random() < 0.4, rng.random() < 0.25, rng.random() < 0.5
    slides, holds = sliding if slides is None else slides, at_rest if holds is None else holds
    speed = rng.uniform(0.1, 0.3 if slides else 0.5)
    stiffness = np.repeat([math.exp(rng.uniform(math.log(75), math.log(250))), rng.uniform(300, 700)], 3)
    meets_at = rng.uniform(0.25, 0.6)
    plant = sample_plant(rng, arm.n)
    for _ in range(_TRIES):
        pose = _sample_pose(rng, slides)
        path = np.zeros(3) if holds else _sample_path(rng, slides)
        postures = _reachable(arm, pose, path, slides, rng)
        if postures is not None:
            return Motion(seed, slides, pose, path, speed, limited, stiffness, postures, meets_at, plant)
    raise UnreachableError(
        f"arm '{arm.name}' follows none of {_TRIES} random paths 0.3 to 0.7 m before its base, the tool pointing down; "
        "give an arm of that reach, such as contactsafe.robots.panda()"
    )


def _sample_pose(rng: np.random.Generator, slides: bool) -> Pose:
    x, y, z = SURFACE_CENTRE
    if slides:
        position = np.array([x + rng.uniform(-0.15, 0.15), y + rng.uniform(-0.2, 0.2), z - _PRESS_M])
        return Pose(position, DOWN.copy())
    position = np.array([rng.uniform(0.3, 0.65), rng.uniform(-0.4, 0.4), rng.uniform(z + 0.08, 0.6)])
    return Pose(position, quat_multiply(rotvec_to_quat(rng.uniform(-0.4, 0.4, 3)), DOWN))


def _sample_path(rng: np.random.Generator, slides: bool) -> np.ndarray:
    direction = rng.standard_normal(3)
    if slides:
        direction[2] = 0.0
    return rng.uniform(0.2, 0.45) * direction / np.linalg.norm(direction)


def _reachable(arm: Arm, pose: Pose, path: np.ndarray, slides: bool, rng: np.random.Generator) -> np.ndarray | None:
    """Return joint positions at the start of a path that the arm can follow within its range; None if it cannot."""
    q = arm.home + (0.0 if slides else rng.uniform(-0.5, 0.5, arm.n))
    q_start, nominal = None, arm.nominal()
    for fraction in np.linspace(0.0, 1.0, 6):
        position = pose.position + fraction * path
        if position[2] < (-0.005 if slides else 0.06) or np.linalg.norm(position[:2]) > 0.72:
            return None
        seed, q = q, np.empty(arm.n)
        error, turn = solve_ik(nominal.handle, position, pose.quat, seed, arm.q_min, arm.q_max, q)
        if error > POSITION_TOLERANCE or turn > 1e-2:
            return None
        if (q < arm.q_min + _MARGIN_RAD).any() or (q > arm.q_max - _MARGIN_RAD).any():
            return None
        q_start = q if q_start is None else q_start
    return q_start
