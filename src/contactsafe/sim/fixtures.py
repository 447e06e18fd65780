"""What stands about an arm and does not move: bodies of boxes, the same for every backend."""

from dataclasses import dataclass

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

MAX_FIXTURES = 4
"""Most fixtures one world holds."""

TABLE_HALF_SIZE = (0.6, 0.9, 0.025)
"""Half edges of the workbench's table, m."""

PLATE_HALF_THICKNESS = 0.005
"""Half the height of the plate on it, m."""


@dataclass(frozen=True)
class Box:
    """One box of a fixture.

    Attributes:
        name: of its geom; unique in the world.
        centre: in the fixture's frame, m.
        half_size: half edges, m.
        quat: orientation in the fixture's frame, w x y z.
        rgba: colour.
    """

    name: str
    centre: Vector3
    half_size: Vector3
    quat: Quaternion = (1.0, 0.0, 0.0, 0.0)
    rgba: Quaternion = (0.72, 0.66, 0.58, 1.0)


@dataclass(frozen=True)
class Fixture:
    """A body that stands still.

    Attributes:
        name: of the body; unique in the world.
        position: of its frame, world, m.
        boxes: its shape.
        quat: orientation of its frame, w x y z.
        solref: MuJoCo's contact time constant, s, and damping ratio; by default four ticks, plastic on metal.
    """

    name: str
    position: Vector3
    boxes: tuple[Box, ...]
    quat: Quaternion = (1.0, 0.0, 0.0, 0.0)
    solref: tuple[float, float] = (0.004, 1.0)


@dataclass(frozen=True)
class TipSurface:
    """The surface of the tool's tip; its friction and softness prevail over those of what it touches.

    Attributes:
        friction: Coulomb coefficient.
        solref, solimp: of MuJoCo's contacts. The default is felt: measured 4.8 kN/m a corner of a box that touches, so
            19 kN/m flat on a plate, 10 kN/m on an edge.
    """

    friction: float = 0.3
    solref: tuple[float, float] = (0.15, 0.4)
    solimp: Vector3 = (0.5, 0.5, 0.001)


def workbench(centre: Vector3 = (0.5, 0.0, 0.01), size: tuple[float, float] = (0.5, 0.6)) -> Fixture:
    """Return a table before the arm with a plate on it.

    Args:
        centre: of the plate's upper face, world, m; the origin of the fixture's frame.
        size: edges of the plate along x and y, m.
    """
    thickness = PLATE_HALF_THICKNESS
    table = Box("table", (0.0, -centre[1], -(2 * thickness + TABLE_HALF_SIZE[2])), TABLE_HALF_SIZE)
    plate = Box("plate", (0.0, 0.0, -thickness), (size[0] / 2, size[1] / 2, thickness), rgba=(0.97, 0.97, 0.97, 1.0))
    return Fixture("workbench", centre, (table, plate))
