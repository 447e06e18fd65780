"""Ink on the whiteboard: a grid of cells, strokes and blobs painted at random, erased by a pressed pad."""

import math

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.wiping.board import BoardConfig

CLEAN, INK, OBJECT = 0, 1, 2
"""What a cell holds. An OBJECT looks like ink to the camera, and no pad removes it."""


class Whiteboard(Independent):
    """A board and its ink.

    Attributes:
        cells: what lies in each cell, uint8, (rows along x, columns along y).
        changed: whether anything was painted, laid or cleared since this was last set to false. Who writes ink into the
            cells by other means than the methods here sets it; who takes ink away need not.
    """

    def __init__(self, config: BoardConfig):
        self.config = config
        self.cells = np.zeros(tuple(round(edge / config.cell) for edge in config.size), dtype=np.uint8)
        self.changed = True
        x, y, _ = config.centre
        self.origin = np.array([x - config.size[0] / 2, y - config.size[1] / 2])
        side = round(config.ink_size / config.cell)
        first = [
            round((middle - config.ink_size / 2 - corner) / config.cell)
            for middle, corner in zip((x, y), self.origin, strict=True)
        ]
        self._ink_rows, self._ink_columns = (slice(start, start + side) for start in first)

    @property
    def ink_cells(self) -> int:
        """Number of cells that hold ink."""
        return int(np.count_nonzero(self.cells == INK))

    def clear(self) -> None:
        """Remove everything."""
        self.cells[:] = CLEAN
        self.changed = True

    def paint(self, drawing: np.ndarray) -> None:
        """Put a drawing on the part of the board that may be painted on.

        Args:
            drawing: true where ink is, (n, n); scaled to the area by nearest cell, row 0 nearest the robot.

        Raises:
            InvalidInputError: not a square image.
        """
        drawing = square_image(drawing)
        area = self.cells[self._ink_rows, self._ink_columns]
        index = (np.arange(area.shape[0]) + 0.5) * drawing.shape[0] / area.shape[0]
        index = index.astype(int)
        area[:] = np.where(drawing[np.ix_(index, index)] != 0, INK, CLEAN)
        self.changed = True

    def sample_random(self, rng: np.random.Generator) -> None:
        """Paint one to four strokes and up to two blobs somewhere in the ink area."""
        size = self._ink_rows.stop - self._ink_rows.start
        drawing = np.zeros((size, size), dtype=np.uint8)
        for _ in range(rng.integers(1, 5)):
            _paint_stroke(drawing, rng, self.config.cell)
        for _ in range(rng.integers(0, 3)):
            centre = rng.uniform(0.1, 0.9, 2) * size
            _stamp(drawing, centre[0], centre[1], rng.uniform(0.006, 0.016) / self.config.cell)
        self.paint(drawing)

    def place_object(self, centre: tuple[float, float], size: tuple[float, float]) -> None:
        """Lay a flat dark object on the board.

        Args:
            centre: x, y in the world, m.
            size: along x and y, m.
        """
        low = (np.array(centre) - np.array(size) / 2 - self.origin) / self.config.cell
        high = (np.array(centre) + np.array(size) / 2 - self.origin) / self.config.cell
        i0, j0 = np.maximum(np.round(low).astype(int), 0)
        i1, j1 = np.maximum(np.round(high).astype(int), 0)
        self.cells[i0:i1, j0:j1] = OBJECT
        self.changed = True


def _paint_stroke(drawing: np.ndarray, rng: np.random.Generator, cell: float) -> None:
    """Sample a smooth random walk of the pen: 8 to 28 cm long, 6 to 12 mm wide."""
    size = drawing.shape[0]
    radius = rng.uniform(0.003, 0.006) / cell
    point = rng.uniform(0.1, 0.9, 2) * size
    heading, turning = rng.uniform(-math.pi, math.pi), 0.0
    for _ in range(int(rng.uniform(0.08, 0.28) / cell)):
        _stamp(drawing, point[0], point[1], radius)
        turning = 0.9 * turning + rng.normal(0.0, 0.03)
        heading += turning
        point += (math.cos(heading), math.sin(heading))
        outside = (point < radius) | (point > size - radius)
        if outside.any():
            point = np.clip(point, radius, size - radius)
            heading += math.pi / 2


@compiled
def _stamp(drawing, row, column, radius):
    """Ink the cells whose centres lie within a disc; all in cells."""
    size = drawing.shape[0]
    for i in range(max(0, int(row - radius)), min(size, int(row + radius) + 2)):
        for j in range(max(0, int(column - radius)), min(size, int(column + radius) + 2)):
            if (i + 0.5 - row) ** 2 + (j + 0.5 - column) ** 2 <= radius * radius:
                drawing[i, j] = 1


@compiled
def erase_under_pad(
    cells: np.ndarray,
    origin_x: float,
    origin_y: float,
    cell: float,
    position: Vector,
    rotation: Matrix,
    half_x: float,
    half_y: float,
) -> int:
    """Erase ink under a rectangular pad.

    Args:
        cells: uint8, (rows, columns); updated.
        origin_x, origin_y: world corner of cell (0, 0), m.
        cell: edge, m.
        position: centre of the pad's face, (3,), m.
        rotation: pad axes in the world, (3, 3).
        half_x, half_y: half edges of the pad, m.

    Returns:
        Number of cells erased.
    """
    reach_x = abs(rotation[0, 0]) * half_x + abs(rotation[0, 1]) * half_y
    reach_y = abs(rotation[1, 0]) * half_x + abs(rotation[1, 1]) * half_y
    i0 = max(0, int((position[0] - reach_x - origin_x) / cell))
    i1 = min(cells.shape[0], int((position[0] + reach_x - origin_x) / cell) + 1)
    j0 = max(0, int((position[1] - reach_y - origin_y) / cell))
    j1 = min(cells.shape[1], int((position[1] + reach_y - origin_y) / cell) + 1)
    erased = 0
    for i in range(i0, i1):
        for j in range(j0, j1):
            if cells[i, j] != 1:
                continue
            dx = origin_x + (i + 0.5) * cell - position[0]
            dy = origin_y + (j + 0.5) * cell - position[1]
            u = rotation[0, 0] * dx + rotation[1, 0] * dy
            v = rotation[0, 1] * dx + rotation[1, 1] * dy
            if abs(u) <= half_x and abs(v) <= half_y:
                cells[i, j] = 0
                erased += 1
    return erased


def square_image(drawing: ArrayLike) -> np.ndarray:
    """Return a drawing as an array, (n, n).

    Raises:
        InvalidInputError: not a square image.
    """
    image = np.asarray(drawing)
    if image.ndim != 2 or image.shape[0] != image.shape[1] or image.shape[0] == 0:
        raise InvalidInputError(f"drawing has shape {image.shape}; give a square image, (n, n), true where ink is")
    return image
