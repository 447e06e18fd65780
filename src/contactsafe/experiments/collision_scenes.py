"""Random collisions: what the arm meets on its motion, and where.

The motion is run once without obstacles; each obstacle is then placed where a random point of a random link will be.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from contactsafe.experiments.collision_motions import Motion, scene_rng
from contactsafe.experiments.surfaces import clearance, sample_surface_point
from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.description import Vector3
from contactsafe.robot.shape import link_frames
from contactsafe.sim.obstacles import Obstacle

_CLEAR_M = 0.002

_SOFT_S = 0.02  # time constant of the obstacle's surface, s

_DEEPEST_M = 0.03  # what comes to a held arm goes no further than this into where the arm was


@dataclass(frozen=True)
class Meeting:
    """An obstacle and the point of the arm that meets it.

    Attributes:
        obstacle: what is met.
        link: of the arm, 2 … n + 1, n + 1 being the tool.
    """

    obstacle: Obstacle
    link: int


def met_links(arm: Arm) -> range:
    """Return the links that are met, of an arm of n joints: 2 … n + 1, n + 1 being the tool."""
    return range(2, arm.n + 2)


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
    link = int(rng.choice(met_links(arm)))
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
