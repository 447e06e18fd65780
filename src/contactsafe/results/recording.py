"""One trial in time, for plots and films, and the stage it played on."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from contactsafe.robot.description import ArmDescription, Tool

Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Recording:
    """One trial in time.

    Attributes:
        scenario, controller, seed: of the trial.
        trace: `trace_dtype` records, one a millisecond, (T,).
        obstacle: radius m and half length m (0 for a sphere) of the obstacle; None without one.
        pictures: what lay on the stage's surface every `picture_every` ticks, uint8 (F, rows along x, columns along
            y); values are keys of `Stage.colours`. None where nothing lies there.
        picture_every: ticks between pictures.
        curves: what else was recorded, one value a tick, by name, (T,).
    """

    scenario: str
    controller: str
    seed: int
    trace: np.ndarray
    obstacle: tuple[float, float] | None = None
    pictures: np.ndarray | None = None
    picture_every: int = 1
    curves: Mapping[str, np.ndarray] = field(default_factory=dict)

    def picture(self, tick: int) -> np.ndarray | None:
        """Return what lay on the surface at a tick."""
        if self.pictures is None:
            return None
        return self.pictures[min(tick // self.picture_every, len(self.pictures) - 1)]


@dataclass(frozen=True)
class Stage:
    """What is filmed: an arm with its tool, over a flat surface.

    Attributes:
        arm: its description.
        tool: what it carries.
        corners: of the surface, level, from its corner of least x and y along x, then along y, world, (4, 3), m.
        colours: RGB of a picture's values; those not named are transparent.
    """

    arm: ArmDescription
    tool: Tool
    corners: tuple[tuple[float, float, float], ...]
    colours: Mapping[int, Colour] = field(default_factory=dict)


@dataclass(frozen=True)
class Portrait:
    """One picture of an arm that stands still, and of a sphere that it is going to meet.

    Attributes:
        name: what is written beneath.
        stage: the arm, its tool and the floor.
        q: joint positions, (n,), rad.
        sphere: its centre, world, (3,), m; None without one.
        radius: of it, m.
    """

    name: str
    stage: Stage
    q: np.ndarray
    sphere: np.ndarray | None = None
    radius: float = 0.0


def level_rectangle(centre: tuple[float, float, float], size: tuple[float, float]) -> tuple:
    """Return the corners of a level rectangle as `Stage` has them.

    Args:
        centre: world, m.
        size: along x and y, m.
    """
    x, y, z = centre
    dx, dy = size[0] / 2, size[1] / 2
    return ((x - dx, y - dy, z), (x + dx, y - dy, z), (x + dx, y + dy, z), (x - dx, y + dy, z))
