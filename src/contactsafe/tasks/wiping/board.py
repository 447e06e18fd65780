"""The whiteboard and the camera that looks at it."""

from dataclasses import dataclass, replace

from contactsafe.robot.arm import Arm
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.fixtures import TipSurface, Vector3, workbench
from contactsafe.tasks.base.tip import tip_of


@dataclass(frozen=True)
class BoardConfig:
    """The whiteboard on the table before the arm.

    Attributes:
        centre: of its upper face, world, m.
        size: along x and y, m.
        ink_size: edge of the square in its middle that may be drawn on, m.
        cell: edge of one ink cell, m.
        friction: Coulomb coefficient of pad on board.
        press_n: force with which the pad must be pressed to erase, N.
    """

    centre: Vector3 = (0.5, 0.0, 0.01)
    size: tuple[float, float] = (0.5, 0.6)
    ink_size: float = 0.3
    cell: float = 0.002
    friction: float = 0.3
    press_n: float = 0.5


@dataclass(frozen=True)
class Camera:
    """A pinhole camera on a stand, looking at the board at an angle.

    The defaults are a RealSense D455's colour image (1280 × 720, 640 px focal length by data sheet FOV 90° × 65°),
    cropped to the 455 px square around the board and scaled to 128.

    Attributes:
        position: world, m.
        target: point in the middle of the image, world, m.
        focal_px: focal length in pixels of the 128 × 128 image.
        size: pixels along an edge.
    """

    position: Vector3 = (1.05, 0.0, 0.65)
    target: Vector3 = (0.5, 0.0, 0.01)
    focal_px: float = 180.0
    size: int = 128


def furnish(world: WorldConfig, board: BoardConfig) -> WorldConfig:
    """Return a world with this board in it and felt for the pad; whatever fixtures it had make room."""
    return replace(world, fixtures=(workbench(board.centre, board.size),), tip=TipSurface(friction=board.friction))


def pad_half(arm: Arm) -> Vector3:
    """Return the half edges of an arm's pad, m.

    Raises:
        InvalidInputError: its tool has no box for a tip.
    """
    return tip_of(arm, "box", "wiping", "robots.WIPER").half_size
