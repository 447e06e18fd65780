"""Random collisions: what the arm does, what it meets and where, and how the plant differs from its model.

A scene depends on its seed alone. The motion is run once without obstacles; the obstacle is then placed where a random
point of a random link will be.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from contactsafe.core.rotation import quat_multiply, rotvec_to_quat
from contactsafe.experiments.surfaces import clearance, description_and_tool, sample_surface_point
from contactsafe.policy.action import DOWN
from contactsafe.robot.arm import Arm, Pose
from contactsafe.robot.description import Vector3
from contactsafe.robot.ik import POSITION_TOLERANCE, solve_ik
from contactsafe.robot.shape import link_frames
from contactsafe.sim.config import REAL_SENSORS, PlantConfig, WorldConfig
from contactsafe.sim.fixtures import workbench
from contactsafe.sim.obstacles import Obstacle
from contactsafe.tasks.base.evaluation import HELD_OUT_SEED

TARGET_OFFSET_MAX_M = 0.05
"""Largest distance of a policy's x_d from the tool, m."""

SURFACE_CENTRE = workbench().position
"""Of the level surface that the tool slides on, world, m."""

LINKS = (2, 3, 4, 5, 6, 7, 8)
"""Links that are met; 8 is the hand."""

AFTER_S = 2.5
"""How long a trial goes on after the arm would reach the obstacle, s."""

_PRESS_M = 0.004  # depth of x_d below the surface that the tool slides on
_MARGIN_RAD = 0.15  # of the joint range, kept free along the path
_CLEAR_M = 0.002
_SOFT_S = 0.02  # time constant of the obstacle's surface, s
_DEEPEST_M = 0.03  # what comes to a held arm goes no further than this into where the arm was


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

    def world(self, obstacles: tuple[Obstacle, ...], real: bool) -> WorldConfig:
        """Return the world to run it in, with the plant and sensors as they are or as the controller believes."""
        if real:
            return WorldConfig(plant=self.plant, sensors=REAL_SENSORS, obstacles=obstacles)
        return WorldConfig(obstacles=obstacles)


@dataclass(frozen=True)
class Meeting:
    """An obstacle and the point of the arm that meets it.

    Attributes:
        obstacle: what is met.
        link: of the arm, 2 … 8, 8 being the hand.
    """

    obstacle: Obstacle
    link: int


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


def sample_motion(arm: Arm, seed: int) -> Motion:
    """Sample what the tool does: a sweep of 20 to 45 cm at 0.1 to 0.5 m/s or a hold, in free air or sliding."""
    rng = scene_rng(seed, 0)
    slides, holds, limited = rng.random() < 0.4, rng.random() < 0.25, rng.random() < 0.5
    speed = rng.uniform(0.1, 0.3 if slides else 0.5)
    stiffness = np.repeat([math.exp(rng.uniform(math.log(75), math.log(250))), rng.uniform(300, 700)], 3)
    meets_at = rng.uniform(0.25, 0.6)
    plant = sample_plant(rng, arm.n)
    while True:
        pose = _sample_pose(rng, slides)
        path = np.zeros(3) if holds else _sample_path(rng, slides)
        postures = _reachable(arm, pose, path, slides, rng)
        if postures is not None:
            return Motion(seed, slides, pose, path, speed, limited, stiffness, postures, meets_at, plant)


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


def sample_meetings(arm: Arm, motion: Motion, q_free: np.ndarray) -> tuple[Meeting, ...]:
    """Place one obstacle, or for a quarter of the scenes two, on the surface of the arm as it will move.

    Args:
        arm: built from a description.
        motion: what the tool does.
        q_free: joint positions while it does so and nothing is in its path, one row a ms, (T, n), rad.
    """
    rng = scene_rng(motion.seed, 1)
    meetings: list[Meeting] = []
    wanted = 2 if rng.random() < 0.25 else 1
    while len(meetings) < wanted:
        meeting = _sample_meeting(arm, motion, q_free, rng)
        if meeting is not None and all(meeting.link != other.link for other in meetings):
            meetings.append(meeting)
    return tuple(meetings)


def _sample_meeting(arm: Arm, motion: Motion, q_free: np.ndarray, rng: np.random.Generator) -> Meeting | None:
    link = int(rng.choice(LINKS))
    radius = rng.uniform(0.02, 0.06)
    thing = sample_obstacle(rng, radius, may_be_fixed=not motion.holds)
    speed, push_n = rng.uniform(0.05, 0.25), rng.uniform(2.0, 10.0)
    when = len(q_free) - 1 if motion.holds else min(round(1000 * motion.meets_s), len(q_free) - 1)
    point, normal = sample_surface_point(arm, link, rng)
    description, _ = description_and_tool(arm)
    frames = [link_frames(description, q_free[[t]]) for t in (when - 20, when)]
    before, at = ((o[0, link] + R[0, link] @ point) for o, R in frames)
    normal = frames[1][1][0, link] @ normal
    centre = at + (radius + _CLEAR_M) * normal
    if motion.holds:
        gap = 0.4 * speed
        start = _touching(arm, q_free[[when]], at, normal, radius) + gap * normal
        obstacle = replace(
            thing,
            position=_vector(start),
            travel=_vector(-(gap + _DEEPEST_M) * normal),
            travel_s=(0.2, motion.meets_s + _DEEPEST_M / speed),
            travel_until_n=push_n,
        )
        clear = clearance(arm, q_free[:1], start) > radius
        return Meeting(obstacle, link) if clear else None
    velocity = (at - before) / 0.02
    if velocity @ normal < max(0.02, 0.3 * float(np.linalg.norm(velocity))):
        return None
    clear = clearance(arm, q_free[: when - 10 : 10], centre) > radius
    return Meeting(replace(thing, position=_vector(centre)), link) if clear else None


def _touching(arm: Arm, q: np.ndarray, at: np.ndarray, normal: np.ndarray, radius: float) -> np.ndarray:
    """Return where on a line a sphere just touches the arm: the point sampled may lie within another capsule."""
    near, far = 0.0, 0.5
    while far - near > 1e-5:
        middle = 0.5 * (near + far)
        near, far = (near, middle) if clearance(arm, q, at + middle * normal) > radius else (middle, far)
    return at + far * normal


def sample_obstacle(rng: np.random.Generator, radius: float, may_be_fixed: bool) -> Obstacle:
    """Sample a sphere of 0.5 to 5 kg on springs, log-uniform 1 to 75 kN/m, or (one in eight) a fixed one."""
    stiffness = math.exp(rng.uniform(math.log(1e3), math.log(75e3)))
    mass, fixed = math.exp(rng.uniform(math.log(0.5), math.log(5.0))), rng.random() < 0.125
    return Obstacle((0.0, 0.0, 0.0), radius, math.inf if fixed and may_be_fixed else stiffness, mass, surface_s=_SOFT_S)


def _vector(value: np.ndarray) -> Vector3:
    x, y, z = value.tolist()
    return (x, y, z)
