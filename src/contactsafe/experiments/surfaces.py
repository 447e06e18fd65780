"""Points on the surface of an arm, and how far others are from it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.shape import arm_capsules

_TOUCHING_M = 1e-6  # rounding: a point of the surface is this far within it at most


def sample_surface_point(arm: Arm, link: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Sample a point of a link's capsules and the outward normal there, in the link's frame, (3,) m and (3,)."""
    description, tool = description_and_tool(arm)
    capsules = tool.capsules if link > arm.n else description.links[link - 1].capsules
    capsule = capsules[rng.integers(len(capsules))]
    start, end = np.array(capsule.start), np.array(capsule.end)
    normal = rng.standard_normal(3)
    normal /= np.linalg.norm(normal)
    along = end - start
    foot = start + rng.random() * along
    if along @ normal > 0 and rng.random() < 0.3:
        foot = end  # a round end
    else:
        axis = along / np.linalg.norm(along)
        normal -= (normal @ axis) * axis
        normal /= np.linalg.norm(normal)
    return foot + capsule.radius * normal, normal


class Place(NamedTuple):
    """A point of the arm's surface in one posture.

    Attributes:
        link: 1 … n.
        point: in the link's frame, (3,), m.
        world: the same in world axes, (3,), m.
        inwards: normal into the link, world, (3,).
    """

    link: int
    point: np.ndarray
    world: np.ndarray
    inwards: np.ndarray


def sample_place(
    arm: Arm, origins: np.ndarray, rotations: np.ndarray, links: Sequence[int], rng: np.random.Generator
) -> Place:
    """Sample a link, and a point of its surface, which something may cover.

    Args:
        arm: built from a description.
        origins, rotations: frames of `link_frames` in one posture, (n + 2, 3) m and (n + 2, 3, 3).
        links: to choose from.
        rng: of the sample.
    """
    link = int(rng.choice(links))
    point, normal = sample_surface_point(arm, link, rng)
    return Place(link, point, origins[link] + rotations[link] @ point, -rotations[link] @ normal)


def clearance(arm: Arm, q: np.ndarray, point: np.ndarray) -> float:
    """Return the least distance of a point from the arm's capsules over postures q (T, n), m."""
    starts, ends, radii, _ = arm_capsules(*description_and_tool(arm), q)
    along = ends - starts
    fraction = np.einsum("fki,fki->fk", point - starts, along) / np.einsum("fki,fki->fk", along, along)
    nearest = starts + np.clip(fraction, 0.0, 1.0)[..., None] * along
    return float((np.linalg.norm(point - nearest, axis=2) - radii).min())


def is_uncovered(arm: Arm, q: np.ndarray, place: np.ndarray, inwards: np.ndarray) -> bool:
    """Tell whether a point of a link's surface can be touched: no other link covers it or is right before it.

    Args:
        arm: built from a description.
        q: its joint positions, (n,), rad.
        place: of the point, world, (3,), m.
        inwards: opposite of the outward normal there, world, (3,).
    """
    if clearance(arm, q[None], place) < -_TOUCHING_M:
        return False
    return clearance(arm, q[None], place - 1e-3 * inwards) >= 0.5e-3
