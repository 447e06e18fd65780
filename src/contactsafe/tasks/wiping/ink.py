"""Which cells of a board are not clean, and which pixels show them: kept from look to look, for wiping only takes away.

A board has ten times as many cells as hold ink, and a mask ten times as many pixels as show any: going through all of
them in every step cost a third as much as its physics and control.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsafe.core.arrays import Vector
from contactsafe.core.byte_scan import places_unlike
from contactsafe.core.compiled import compiled
from contactsafe.tasks.wiping.whiteboard import CLEAN, INK


class InkIndex(NamedTuple):
    """Where ink lies on N boards: as entered last, less what was wiped off until the index was last updated.

    Attributes:
        cells: row and column of each cell that is not clean, in order, int16 (n, rows · columns, 2).
        entries: how many those are, (n,).
        shown: in how many of them each pixel has a part, uint16 (n, size, size).
    """

    cells: np.ndarray
    entries: np.ndarray
    shown: np.ndarray


def empty_ink_index(n: int, cells: int, size: int) -> InkIndex:
    """Make an `InkIndex` of n clean boards of so many cells, seen by cameras of size × size pixels."""
    return InkIndex(
        cells=np.zeros((n, cells, 2), dtype=np.int16),
        entries=np.zeros(n, dtype=np.int64),
        shown=np.zeros((n, size, size), dtype=np.uint16),
    )


@compiled(nogil=True)
def enter(ink_index: InkIndex, i: int, cells: np.ndarray, pixels: np.ndarray) -> None:
    """Enter board i as it is now.

    Args:
        ink_index: `InkIndex`; updated.
        i: which board.
        cells: the board's, uint8, (rows, columns).
        pixels: of the camera that looks at it, see `CameraTables`.
    """
    ink_index.entries[i] = list_cells(cells, ink_index.cells[i])
    count_shown(pixels, ink_index.cells[i, : ink_index.entries[i]], ink_index.shown[i])


@compiled
def remove_erased(ink_index: InkIndex, i: int, cells: np.ndarray, pixels: np.ndarray) -> None:
    """Take out of board i's entries what has been wiped since; arguments as for `enter`."""
    listed, shown = ink_index.cells[i], ink_index.shown[i]
    kept = 0
    for m in range(ink_index.entries[i]):
        row, column = listed[m, 0], listed[m, 1]
        if cells[row, column] == CLEAN:
            _add(shown, pixels, row, column, -1)
        else:
            listed[kept, 0], listed[kept, 1] = row, column
            kept += 1
    ink_index.entries[i] = kept


@compiled
def list_cells(cells: np.ndarray, out: np.ndarray) -> int:
    """Write row and column of each cell that is not clean to `out`, (rows · columns, 2); return their number."""
    columns = cells.shape[1]
    numbers = np.empty(cells.size, dtype=np.int32)
    count = places_unlike(cells.reshape(-1), np.uint8(CLEAN), numbers)
    for m in range(count):
        out[m, 0], out[m, 1] = numbers[m] // columns, numbers[m] % columns
    return count


@compiled
def count_shown(pixels: np.ndarray, listed: np.ndarray, shown: np.ndarray) -> None:
    """Count for each pixel, (size, size), in how many of the listed cells, (count, 2), it has a part."""
    shown[:] = 0
    for m in range(listed.shape[0]):
        _add(shown, pixels, listed[m, 0], listed[m, 1], 1)


@compiled
def _add(shown, pixels, row, column, number):
    for k in range(4):
        v, u = pixels[row, column, k, 0], pixels[row, column, k, 1]
        if v < 0:
            return
        shown[v, u] += number


@compiled(nogil=True)
def nearest_ink(
    ink_index: InkIndex, i: int, cells: np.ndarray, origin: Vector, cell: float, position: Vector
) -> tuple[int, float]:
    """Count the ink and find how far the nearest of it lies from a point along the board.

    Args:
        ink_index: `InkIndex`.
        i: which board.
        cells: the board's, uint8, (rows, columns).
        origin: world corner of cell (0, 0), (2,), m.
        cell: edge, m.
        position: (≥ 2,), m.

    Returns:
        Number of ink cells; distance, m, 0 where there is none.
    """
    listed = ink_index.cells[i]
    count = 0
    best = math.inf
    px, py = (position[0] - origin[0]) / cell - 0.5, (position[1] - origin[1]) / cell - 0.5
    for m in range(ink_index.entries[i]):
        row, column = listed[m, 0], listed[m, 1]
        if cells[row, column] == INK:
            count += 1
            best = min(best, (row - px) * (row - px) + (column - py) * (column - py))
    if count == 0:
        return 0, 0.0
    return count, math.sqrt(best) * cell
