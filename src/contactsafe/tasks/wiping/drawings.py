"""Kinds of boards by name: random strokes, rows of handwritten digits, text, and both."""

from typing import Literal, get_args

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.wiping.handwriting import FONTS, WORDS, write_digits, write_words
from contactsafe.tasks.wiping.whiteboard import Whiteboard

Boards = Literal["strokes", "digits", "text", "handwriting"]
BOARDS: tuple[str, ...] = get_args(Boards)
"""Names of the kinds: `Whiteboard.sample_random`'s strokes, people's digits, words, and lines of either."""

_PEN_M = (0.0025, 0.004)  # radius of the pen's line, m
_LINE = 1.6  # from line to line, in heights of a capital


def check_boards(kind: str) -> None:
    """Refuse a kind of board that there is not.

    Raises:
        InvalidInputError: not one of BOARDS.
    """
    if kind not in BOARDS:
        raise InvalidInputError(f"boards = {kind!r}; choose {', '.join(BOARDS[:-1])} or {BOARDS[-1]}")


def paint_board(board: Whiteboard, kind: str, rng: np.random.Generator) -> None:
    """Draw on a board, upright as its camera sees it.

    Args:
        board: what to draw on; what its ink area held is gone.
        kind: one of BOARDS.
        rng: the same one draws the same.

    Raises:
        InvalidInputError: there is no such kind, or what it needs is not installed.
    """
    check_boards(kind)
    if kind == "strokes":
        board.sample_random(rng)
    else:
        board.paint(_written(_page(kind, rng), board.config.ink_size, board.config.cell, rng))


def _page(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Write one to three lines by one hand: points along the pen's path, (k, 2), in heights of a capital."""
    font = FONTS[rng.integers(len(FONTS))]
    lines = []
    for k in range(rng.integers(1, 4)):
        if kind == "digits" or (kind == "handwriting" and rng.uniform() < 0.5):
            line = write_digits(int(rng.integers(2, 6)), rng)
        else:
            line = write_words(WORDS[rng.integers(len(WORDS))], font, rng)
        lines.append(line + np.array([_LINE * k, rng.uniform(0.0, 0.8)]))
    points = np.concatenate(lines)
    slant, slope = rng.normal(0.1, 0.12), rng.normal(0.0, 0.05)
    down, right = points.T
    right = right - slant * down
    return np.column_stack([down - slope * right, right + slope * down])


def _written(points: np.ndarray, edge: float, cell: float, rng: np.random.Generator) -> np.ndarray:
    """Put a page somewhere in a square and ink it with a pen; true where ink is, (n, n).

    Args:
        points: (k, 2), in heights of a capital.
        edge: of the square, m.
        cell: m.
        rng: chooses height, place and pen.
    """
    radius = rng.uniform(*_PEN_M)
    room = edge - 2 * radius
    points = points - points.min(axis=0)
    points *= min(rng.uniform(0.045, 0.08), room / points.max())
    points += radius + rng.uniform(0.0, 1.0, 2) * (room - points.max(axis=0))
    return _inked(points / cell, radius / cell, round(edge / cell))


def _inked(points: np.ndarray, radius: float, size: int) -> np.ndarray:
    """Ink the cells whose centres lie within a radius of any point; all in cells, (size, size) bool."""
    drawing = np.zeros((size, size), dtype=bool)
    nearest = np.floor(points).astype(int)
    reach = int(radius) + 1
    for offset in np.ndindex(2 * reach + 1, 2 * reach + 1):
        cells = nearest + np.array(offset) - reach
        near = ((cells + 0.5 - points) ** 2).sum(axis=1) <= radius**2
        near &= ((cells >= 0) & (cells < size)).all(axis=1)
        drawing[tuple(cells[near].T)] = True
    return drawing
