"""What stands about a simulated Franka, and what touches it, as MJCF for the scene of franky-sim."""

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field

from contactsafe.robot.description import Tool
from contactsafe.sim.fixtures import Box, Fixture, TipSurface
from contactsafe.sim.obstacles import Obstacle

TIP = "contactsafe_tip"
"""Name of the geom that the tool works with."""

OBSTACLE = "contactsafe_obstacle"
"""Beginning of the names of obstacles."""


@dataclass(frozen=True)
class LinkPush:
    """A person's push.

    Attributes:
        link: that is pushed in its middle, 1 … 7.
        force: world, N.
        at_s, for_s: when it begins, s since the robot was taken over, and how long it lasts.
        ramp_s: time from nothing to full force.
    """

    link: int
    force: tuple[float, float, float]
    at_s: float
    for_s: float
    ramp_s: float = 0.05

    def at(self, seconds: float) -> float:
        """Return the fraction of the force that is on."""
        since = seconds - self.at_s
        if not 0.0 <= since < self.for_s:
            return 0.0
        return min(since / self.ramp_s, 1.0)


@dataclass(frozen=True)
class FrankaScene:
    """The scene of a simulated Franka.

    Attributes:
        tool: whose tip is on the hand.
        tip: the surface of that.
        fixtures: what stands still.
        obstacles: on springs or fixed; those that travel are moved by the server.
        pushes: on the arm.
        friction_left: part of its motors' friction that the robot's own torque loop leaves; 1 as franky-sim has it.
    """

    tool: Tool
    tip: TipSurface = field(default_factory=TipSurface)
    fixtures: tuple[Fixture, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    pushes: tuple[LinkPush, ...] = ()
    friction_left: float = 0.2


def _words(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def add_tip(hand: ET.Element, scene: FrankaScene, hand_kg: float) -> None:
    """Put the tip of the scene's tool on the hand's body; its mass is the tool's beyond the hand's."""
    tip, (x, y, z) = scene.tool.tip, scene.tool.tcp
    if tip is None:
        return
    half_height = tip.half_size[2]
    size = tip.half_size if tip.shape == "box" else (tip.half_size[0], half_height)
    ET.SubElement(
        hand, "geom", name=TIP, type=tip.shape, size=_words(size), pos=_words((x, y, z - half_height)),
        mass=f"{max(scene.tool.inertia.mass - hand_kg, 1e-3):.6g}", priority="1", friction=f"{scene.tip.friction} 0 0",
        solref=_words(scene.tip.solref), solimp=_words((*scene.tip.solimp, 0.5, 2.0)), condim="3",
        rgba="0.2 0.35 0.3 1",
    )  # fmt: skip


def add_fixtures(world: ET.Element, fixtures: tuple[Fixture, ...]) -> None:
    """Put up what stands still."""
    for fixture in fixtures:
        body = ET.SubElement(world, "body", name=fixture.name, pos=_words(fixture.position), quat=_words(fixture.quat))
        for box in fixture.boxes:
            _add_box(body, box, fixture.solref)


def _add_box(body: ET.Element, box: Box, solref: tuple[float, float]) -> None:
    ET.SubElement(
        body, "geom", name=box.name, type="box", pos=_words(box.centre), quat=_words(box.quat),
        size=_words(box.half_size), rgba=_words(box.rgba), solref=_words(solref),
    )  # fmt: skip


def add_obstacles(world: ET.Element, obstacles: tuple[Obstacle, ...]) -> None:
    """Put up what the arm may meet, each on three springs."""
    for number, one in enumerate(obstacles):
        body = ET.SubElement(world, "body", name=f"{OBSTACLE}{number}", pos=_words(one.position), gravcomp="1")
        shape = "sphere" if one.half_length == 0.0 else "capsule"
        size = (one.radius,) if one.half_length == 0.0 else (one.radius, one.half_length)
        ET.SubElement(
            body, "geom", name=f"{OBSTACLE}{number}", type=shape, size=_words(size), mass=f"{one.mass:.6g}",
            solref=_words((one.surface_s, 1.0)), rgba="0.85 0.2 0.15 1",
        )  # fmt: skip
        if one.fixed:
            continue
        damping = 2.0 * one.damping_ratio * math.sqrt(one.stiffness * one.mass)
        for axis, name in zip(((1, 0, 0), (0, 1, 0), (0, 0, 1)), "xyz", strict=True):
            ET.SubElement(
                body, "joint", name=f"{OBSTACLE}{number}_{name}", type="slide", axis=_words(axis),
                stiffness=f"{one.stiffness:.9g}", damping=f"{damping:.9g}", armature="0", frictionloss="0",
            )  # fmt: skip
