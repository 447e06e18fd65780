"""The peg, and a block with a hole for it made of boxes."""

import math

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm
from contactsafe.robot.description import Inertia, Tip, Tool
from contactsafe.robot.franka import HAND
from contactsafe.sim.fixtures import TABLE_HALF_SIZE, Box, Fixture, Vector3
from contactsafe.tasks.base.tip import tip_of

PEG_RADIUS = 0.01
"""m."""

RADII = (0.002, 0.03)
"""Least and largest radius of a peg, m: the block has to have room for its hole."""

_PEG_HALF_LENGTH = 0.03
_PEG_KG = 0.1
_TCP = 0.15  # m below the mount

HOLE_DEPTH = 0.03
"""m."""

_SIDES = 24
_WALL_HALF = 0.015  # half the radial thickness of the ring about the hole, m
BLOCK_HALF = 0.08
"""Half edge of the block, m."""


def _cylinder(mass: float, centre: Vector3, radius: float, half_length: float) -> Inertia:
    across = mass * (radius**2 / 4 + half_length**2 / 3)
    return Inertia(mass, centre, (across, across, mass * radius**2 / 2, 0.0, 0.0, 0.0))


PEG = Tool(
    name="franka hand with peg",
    inertia=HAND.inertia + _cylinder(_PEG_KG, (0.0, 0.0, _TCP - _PEG_HALF_LENGTH), PEG_RADIUS, _PEG_HALF_LENGTH),
    tcp=(0.0, 0.0, _TCP),
    capsules=HAND.capsules[:1],
    tip=Tip((PEG_RADIUS, PEG_RADIUS, _PEG_HALF_LENGTH), "cylinder"),
)
"""The gripper with a steel peg of 20 mm diameter, 60 mm long; the TCP is the middle of its lower face."""


def peg_radius(arm: Arm, depth_m: float) -> float:
    """Return the radius of an arm's peg, m.

    Args:
        arm: that works.
        depth_m: to which its peg has to go in, m.

    Raises:
        InvalidInputError: the tip of its tool is no cylinder, or too thin, thick or short a one.
    """
    radius, _, half_length = tip_of(arm, "cylinder", "insertion", "contactsafe.tasks.insertion.scene.PEG").half_size
    if not RADII[0] <= radius <= RADII[1] or 2.0 * half_length < depth_m:
        raise InvalidInputError(
            f"arm '{arm.name}' has a peg of radius {radius:g} m, {2.0 * half_length:g} m long; give it a radius of "
            f"{RADII[0]:g} to {RADII[1]:g} m, and a length of depth_m = {depth_m:g} m or more"
        )
    return radius


def block(mouth: Vector3, radius: float) -> Fixture:
    """Return a block with a hole of this radius, m, its frame at the middle of the hole's mouth, z upwards.

    The wall is a ring of flat boxes that touch the hole's circle, so that the hole is a polygon about it: at its
    corners it is wider by 0.9 %. Four boxes make the rest of the upper face, one the floor.
    """
    boxes = []
    width = (radius + 2 * _WALL_HALF) * math.tan(math.pi / _SIDES)
    for k in range(_SIDES):
        angle = 2 * math.pi * k / _SIDES
        out = radius + _WALL_HALF
        centre = (out * math.cos(angle), out * math.sin(angle), -HOLE_DEPTH / 2)
        turned = (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))
        boxes.append(Box(f"wall{k}", centre, (_WALL_HALF, width, HOLE_DEPTH / 2), turned))
    inner = radius + 2 * _WALL_HALF - 0.004
    rest = (BLOCK_HALF - inner) / 2
    for k, (x, y, half_x, half_y) in enumerate(
        (
            (inner + rest, 0.0, rest, BLOCK_HALF),
            (-inner - rest, 0.0, rest, BLOCK_HALF),
            (0.0, inner + rest, inner, rest),
            (0.0, -inner - rest, inner, rest),
        )
    ):
        boxes.append(Box(f"side{k}", (x, y, -HOLE_DEPTH / 2), (half_x, half_y, HOLE_DEPTH / 2)))
    boxes.append(Box("floor", (0.0, 0.0, -HOLE_DEPTH - 0.005), (BLOCK_HALF, BLOCK_HALF, 0.005)))
    return Fixture("block", mouth, tuple(boxes))


def table() -> Fixture:
    """Return the table that the block stands on."""
    x, y, z = TABLE_HALF_SIZE
    return Fixture("table", (0.5, 0.0, 0.0), (Box("table", (0.0, 0.0, -z), (x, y, z)),))
