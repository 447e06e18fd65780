"""Kinds of boards: within their area, their seeds', of a pen's width, and legible."""

import sys

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy import ndimage
from sklearn.datasets import load_digits

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.wiping import handwriting
from contactsafe.tasks.wiping.board import BoardConfig
from contactsafe.tasks.wiping.drawings import BOARDS, paint_board
from contactsafe.tasks.wiping.whiteboard import INK, Whiteboard

CONFIG = BoardConfig()
WRITTEN = [kind for kind in BOARDS if kind != "strokes"]


def drawn(kind, seed):
    board = Whiteboard(CONFIG)
    paint_board(board, kind, np.random.default_rng(seed))
    return board.cells == INK


@pytest.mark.parametrize("kind", BOARDS)
def test_boards_are_their_seeds(kind):
    assert_array_equal(drawn(kind, 3), drawn(kind, 3))
    assert len({drawn(kind, seed).tobytes() for seed in range(30)}) == 30


def test_strokes_are_the_random_drawings_there_always_were():
    board = Whiteboard(CONFIG)
    board.sample_random(np.random.default_rng(4))
    assert_array_equal(drawn("strokes", 4), board.cells == INK)


@pytest.mark.parametrize("kind", WRITTEN)
def test_writing_lies_within_the_area_and_covers_as_much_as_writing_does(kind):
    shares = []
    for seed in range(40):
        rows, columns = np.nonzero(drawn(kind, seed))
        assert 50 <= rows.min() <= rows.max() < 200
        assert 75 <= columns.min() <= columns.max() < 225
        shares.append(len(rows) / 150**2)
    assert min(shares) > 0.01
    assert max(shares) < 0.3


@pytest.mark.parametrize("kind", WRITTEN)
def test_lines_are_as_wide_as_a_pen(kind):
    """Half of a line's inside lies within a quarter of its width from the edge: 1.2 to 2 mm for pens of 5 to 8."""
    for seed in range(20):
        inside = ndimage.distance_transform_edt(drawn(kind, seed))
        ridge = inside[(inside == ndimage.maximum_filter(inside, 3)) & (inside > 0)]
        width = 2 * (np.median(ridge) - 0.5) * CONFIG.cell
        assert 0.003 < width < 0.010, (seed, width)


def test_a_drawing_replaces_what_was_there():
    board = Whiteboard(CONFIG)
    board.paint(np.ones((1, 1)))
    paint_board(board, "digits", np.random.default_rng(0))
    assert_array_equal(board.cells == INK, drawn("digits", 0))


def test_digits_stay_legible():
    """Redrawn with a pen and reduced to 8 × 8 again, the nearest of the other digits is mostly of the same kind: 85."""
    digits = load_digits()
    right = 0
    for index in range(0, 1000, 10):
        points = handwriting._middle_line(index)
        fine = np.zeros((96, 96))
        places = (points * 72 + [8, 48 - 36 * np.ptp(points[:, 1])]).astype(int)
        fine[tuple(places.T)] = 1
        redrawn = ndimage.binary_dilation(fine, iterations=5).reshape(8, 12, 8, 12).mean(axis=(1, 3))
        away = np.linalg.norm(digits.images / 16 - redrawn, axis=(1, 2))
        away[index] = np.inf
        right += digits.target[np.argmin(away)] == digits.target[index]
    assert right >= 75, right


@pytest.mark.parametrize("kind", ["crayon", "", "Digits"])
def test_other_kinds_are_refused(kind):
    with pytest.raises(InvalidInputError) as caught:
        paint_board(Whiteboard(CONFIG), kind, np.random.default_rng(0))
    assert str(caught.value) == f"boards = {kind!r}; choose strokes, digits, text or handwriting"


@pytest.mark.parametrize(
    ("kind", "module", "package"),
    [("digits", "sklearn.datasets", "scikit-learn"), ("text", "HersheyFonts", "Hershey-Fonts")],
)
def test_what_is_not_installed_is_named(kind, module, package, monkeypatch):
    for cached in (handwriting._digit_images, handwriting._middle_line, handwriting._font):
        cached.cache_clear()
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InvalidInputError) as caught:
        drawn(kind, 0)
    assert str(caught.value) == f"boards with {kind} need {package}; run: pip install 'contactsafe[handwriting]'"
