"""The whiteboard and the camera that looks at it."""

import math
from dataclasses import dataclass, replace

from contactsafe.core.errors import InvalidInputError
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
        ink_size: edge of the square in its middle that may be painted on, m.
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

    def __post_init__(self) -> None:
        """Refuse a board that cannot be."""
        if not 0.0 < self.cell <= self.ink_size <= min(self.size) < math.inf:
            raise InvalidInputError(
                f"board size = {self.size}, ink_size = {self.ink_size}, cell = {self.cell}; give a cell greater than "
                "0 m, an ink_size of at least one cell, and edges of at least ink_size"
            )
        if not (0.0 <= self.friction <= 10.0 and 0.0 <= self.press_n < math.inf):
            raise InvalidInputError(
                f"board friction = {self.friction}, press_n = {self.press_n}; give a friction of 0 to 10, and a force "
                "of 0 N or more"
            )


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

    def __post_init__(self) -> None:
        """Refuse a camera that sees nothing."""
        if not (isinstance(self.size, int) and 1 <= self.size <= 4096 and 0.0 < self.focal_px < math.inf):
            raise InvalidInputError(
                f"camera size = {self.size!r}, focal_px = {self.focal_px}; give 1 to 4096 whole pixels, and a focal "
                "length greater than 0"
            )
        if not math.dist(self.position[:2], self.target[:2]) > 0.0:
            raise InvalidInputError(
                f"camera position = {self.position} is straight above or below its target {self.target}, or no number; "
                "move it aside: its picture stands upright"
            )


def furnish(world: WorldConfig, board: BoardConfig) -> WorldConfig:
    """Return a world with this board in it and felt for the pad; whatever fixtures it had make room."""
    return replace(world, fixtures=(workbench(board.centre, board.size),), tip=TipSurface(friction=board.friction))


def pad_half(arm: Arm) -> Vector3:
    """Return the half edges of an arm's pad, m.

    Raises:
        InvalidInputError: its tool has no box for a tip.
    """
    return tip_of(arm, "box", "wiping", "robots.WIPER").half_size
