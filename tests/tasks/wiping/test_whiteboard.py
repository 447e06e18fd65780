"""Ink on the board: drawn within its area, erased exactly where the pad lies, and only by a pressed pad."""

import math

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from tests.sim.scenes import BOARD_Z, CALM, aim
from tests.tasks.wiping.boards_in_worlds import scene_at

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.wiping.board import BoardConfig
from contactsafe.tasks.wiping.whiteboard import CLEAN, INK, OBJECT, Whiteboard, erase_under_pad

CONFIG = BoardConfig()
HALF_X, HALF_Y = 0.045, 0.035


@pytest.fixture
def board():
    return Whiteboard(CONFIG)


def centres(board):
    """World x, y of every cell's centre, (rows, columns, 2)."""
    i, j = np.meshgrid(*(np.arange(n) for n in board.cells.shape), indexing="ij")
    return board.origin + (np.stack([i, j], axis=-1) + 0.5) * CONFIG.cell


def rotation(yaw):
    """A tool that points down, turned about the vertical."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([1.0, -1.0, -1.0])


def erase(board, position, yaw=0.0):
    return erase_under_pad(
        board.cells, *board.origin, CONFIG.cell, np.array([*position, 0.0]), rotation(yaw), HALF_X, HALF_Y
    )


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2, 0.3, -1.1, math.pi / 4])
def test_a_turned_pad_erases_what_it_covers_and_nothing_else(board, yaw):
    board.cells[:] = INK
    where = np.array([0.5123, -0.0371])
    erased = erase(board, where, yaw)
    along = (centres(board) - where) @ rotation(yaw)[:2, :2]
    under = (np.abs(along[..., 0]) <= HALF_X) & (np.abs(along[..., 1]) <= HALF_Y)
    assert_array_equal(board.cells, np.where(under, CLEAN, INK))
    assert erased == under.sum()
    assert erased * CONFIG.cell**2 == pytest.approx(4 * HALF_X * HALF_Y, rel=0.02)


@pytest.mark.parametrize("where", [(0.25, -0.3), (0.75, 0.3), (0.2, 0.0), (3.0, 3.0), (-3.0, 0.0)])
def test_a_pad_over_the_edge_erases_only_what_is_there(board, where):
    board.cells[:] = INK
    along = np.abs(centres(board) - where)
    under = (along[..., 0] <= HALF_X) & (along[..., 1] <= HALF_Y)
    assert erase(board, where) == under.sum()
    assert board.ink_cells == board.cells.size - under.sum()


def test_one_cell_of_ink_is_gone_when_the_pad_covers_its_centre(board):
    board.cells[100, 150] = INK
    x, y = centres(board)[100, 150]
    assert erase(board, (x + HALF_X + 0.0005, y)) == 0
    assert erase(board, (x + HALF_X - 0.0005, y)) == 1
    assert board.ink_cells == 0


def test_objects_are_never_erased(board):
    board.place_object((0.5, 0.0), (0.04, 0.02))
    cells = np.count_nonzero(board.cells == OBJECT)
    assert cells == 20 * 10
    board.cells[board.cells == CLEAN] = INK
    erase(board, (0.5, 0.0))
    assert np.count_nonzero(board.cells == OBJECT) == cells
    assert board.ink_cells < board.cells.size - cells


def test_an_object_half_off_the_board_is_cut(board):
    board.place_object((0.25, -0.3), (0.1, 0.1))
    assert_array_equal(np.argwhere(board.cells == OBJECT).max(axis=0), (24, 24))


def test_a_drawing_is_scaled_to_the_area_with_row_0_nearest_the_robot(board):
    board.paint(np.array([[1, 0], [0, 0]]))
    inked = centres(board)[board.cells == INK]
    side = CONFIG.ink_size / 2
    assert board.ink_cells == (side / CONFIG.cell) ** 2
    assert inked.min(axis=0) == pytest.approx((0.5 - side, -side), abs=CONFIG.cell)
    assert inked.max(axis=0) == pytest.approx((0.5, 0.0), abs=CONFIG.cell)


def test_a_drawing_of_any_fineness_keeps_its_fraction_of_ink(board):
    rng = np.random.default_rng(0)
    for n in (1, 3, 150, 1000):
        drawing = rng.uniform(size=(n, n)) < 0.4 if n > 1 else np.ones((1, 1))
        board.paint(drawing)
        assert board.ink_cells / 150**2 == pytest.approx(drawing.mean(), abs=0.02)


def test_drawing_anew_replaces_the_ink_and_clear_removes_everything(board):
    board.paint(np.ones((4, 4)))
    board.paint(np.zeros((4, 4)))
    assert board.ink_cells == 0
    board.place_object((0.5, 0.2), (0.02, 0.02))
    board.clear()
    assert not board.cells.any()


@pytest.mark.parametrize("shape", [(3, 4), (4,), (0, 0), (2, 2, 3)])
def test_drawings_that_are_not_square_are_refused(board, shape):
    with pytest.raises(InvalidInputError) as caught:
        board.paint(np.ones(shape))
    assert str(caught.value) == f"drawing has shape {shape}; give a square image, (n, n), true where ink is"


def test_random_drawings_lie_within_the_area_differ_and_are_never_empty(board):
    counts, seen = [], set()
    for seed in range(200):
        board.clear()
        board.sample_random(np.random.default_rng(seed))
        inside = np.abs(centres(board)[board.cells == INK] - (0.5, 0.0)).max()
        assert inside <= CONFIG.ink_size / 2
        counts.append(board.ink_cells)
        seen.add(board.cells.tobytes())
    assert min(counts) > 20
    assert len(seen) == 200
    assert 0.01 < np.mean(counts) / 150**2 < 0.3


def test_random_drawings_are_their_seeds(board):
    board.sample_random(np.random.default_rng(5))
    first = board.cells.copy()
    board.clear()
    board.sample_random(np.random.default_rng(5))
    assert_array_equal(board.cells, first)


def test_nothing_is_erased_without_press():
    """A pad that slides over the ink a millimetre above it leaves it all."""
    scene = scene_at((0.5, 0.0, BOARD_Z + 0.002))
    scene.board.paint(np.ones((1, 1)))
    ink = scene.boards.ink_cells()[0]
    aim(scene.worlds, (0.5, 0.05, BOARD_Z + 0.002))
    trace = scene.wipe(600)
    assert np.linalg.norm(trace["tool_force"], axis=1).max() <= CONFIG.press_n
    assert np.ptp(trace["position"][:, 1]) > 0.02
    assert scene.boards.ink_cells()[0] == ink


def test_a_pressed_pad_leaves_a_clean_track():
    scene = scene_at((0.5, 0.0, BOARD_Z + 0.002), CALM)
    board = scene.board
    board.paint(np.ones((1, 1)))
    ink = scene.boards.ink_cells()[0]
    aim(scene.worlds, (0.5, 0.08, BOARD_Z - 0.008))
    trace = scene.wipe(1500)
    pressed = trace[np.linalg.norm(trace["tool_force"], axis=1) > 2.0]
    under = np.zeros(board.cells.shape, bool)
    for position in pressed["position"][::8]:
        away = np.abs(centres(board) - position[:2])
        under |= (away[..., 0] < HALF_X - 0.006) & (away[..., 1] < HALF_Y - 0.006)
    assert under.sum() > 2000
    assert not (board.cells[under] == INK).any()
    assert ink - scene.boards.ink_cells()[0] < 2.0 * under.sum()
