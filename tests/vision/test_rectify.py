"""The mask in the tool's frame: right place, nothing lost, the board's motion undone."""

import numpy as np
import pytest
from tests.learning.fakes import BOARD, Board, camera_homography, pixel_grid

from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.rectify import rectify

H = camera_homography()
BLANK = np.full((128, 128), 255, np.uint8)


def ink_at(view, window_m, tool_xy):
    """World places of the ink cells of a view, (k, 2), m."""
    rows, columns = np.nonzero(view == 0)
    cells = np.stack([columns, rows], axis=1)
    return tool_xy + ((cells + 0.5) / len(view) - 0.5) * window_m


def test_a_dot_lands_where_the_camera_saw_it():
    rng = np.random.default_rng(0)
    places = pixel_grid(H)
    for _ in range(50):
        v, u = rng.integers(10, 118, 2)
        tool = places[v, u] + rng.uniform(-0.2, 0.2, 2)
        mask = BLANK.copy()
        mask[v, u] = 0
        found = ink_at(rectify(mask[None], tool[None], H)[0], 0.64, tool)
        # Half the diagonal of a 5 mm cell, and of a pixel's footprint.
        footprint = np.abs(places[v + 1, u + 1] - places[v - 1, u - 1]).max() / 2
        assert np.linalg.norm(found - places[v, u], axis=1).max() <= 0.0036 + footprint


@pytest.mark.parametrize("size", [32, 64, 128, 256])
def test_no_speck_of_one_pixel_is_lost(size):
    places = pixel_grid(H)
    inside = np.argwhere(np.abs(places - BOARD).max(axis=-1) < 0.3)
    masks = np.repeat(BLANK[None], len(inside), axis=0)
    masks[np.arange(len(inside)), inside[:, 0], inside[:, 1]] = 0
    views = rectify(masks, np.repeat(BOARD[None], len(inside), axis=0), H, 0.64, size)
    assert (views == 0).any(axis=(1, 2)).all()


def test_a_filled_area_has_no_holes():
    mask = BLANK.copy()
    mask[30:90, 30:90] = 0
    view = rectify(mask[None], BOARD[None], H, 0.2, 256)[0]
    for line in (*view, *view.T):
        changes = np.flatnonzero(np.diff((line == 0).astype(int)))
        assert len(changes) <= 2


def test_board_and_tool_moved_together_give_the_same_view():
    """Cells and pixels quantise differently, so: all ink of one view lies within 1 cell of ink in the other."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        board, tool, shift = Board(rng), BOARD + rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.08, 0.08, 2)
        first = rectify(board.mask(H)[None], tool[None], H)[0]
        board.points = board.points + shift
        second = rectify(board.mask(H)[None], (tool + shift)[None], H)[0]
        for a, b in ((first, second), (second, first)):
            gap = np.abs(np.argwhere(a == 0)[:, None] - np.argwhere(b == 0)[None]).max(axis=2).min(axis=1)
            assert gap.max() <= 3
            assert np.mean(gap <= 1) > 0.95


def test_shifting_the_tool_by_whole_cells_shifts_the_view():
    rng = np.random.default_rng(2)
    mask = Board(rng).mask(H)[None]
    cell = 0.64 / 128
    here = rectify(mask, BOARD[None], H)[0]
    there = rectify(mask, BOARD[None] + [[3 * cell, -2 * cell]], H)[0]
    # Ink moves against the tool: columns by -3, rows by +2.
    np.testing.assert_array_equal(here[4:-4, 4:-4], there[6:-2, 1:-7])


def test_the_homographys_scale_and_sign_do_not_matter():
    mask = Board(np.random.default_rng(3)).mask(H)[None]
    expected = rectify(mask, BOARD[None], H)
    for factor in (-1.0, 1e-3, -250.0):
        np.testing.assert_array_equal(rectify(mask, BOARD[None], factor * H), expected)


def test_out_of_sight_is_no_ink_and_a_lost_tool_sees_nothing():
    all_ink = np.zeros((1, 128, 128), np.uint8)
    assert (rectify(all_ink, np.array([[5.0, 5.0]]), H) == 255).all()
    assert (rectify(all_ink, np.array([[np.nan, 0.0]]), H) == 255).all()


def test_a_window_that_reaches_behind_the_camera_shows_only_what_is_before_it():
    places = pixel_grid(H)
    view = rectify(np.zeros((1, 128, 128), np.uint8), BOARD[None], H, 4.0, 128)[0]
    found = ink_at(view, 4.0, BOARD)
    low, high = places.reshape(-1, 2).min(0), places.reshape(-1, 2).max(0)
    assert (found > low - 0.05).all()
    assert (found < high + 0.05).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"masks": np.zeros((1, 128, 128))},
            "masks are float64 of shape (1, 128, 128); give uint8 of shape (N, height, width)",
        ),
        (
            {"tool_positions": np.zeros((2, 3))},
            "tool_positions have shape (2, 3); give one row of x, y for each of 1 masks",
        ),
        ({"homography": np.zeros((3, 2))}, "homography has shape (3, 2); give a finite (3, 3) matrix"),
        (
            {"homography": np.zeros((3, 3)) + 1.0},
            "homography is singular: the camera would see the board edge-on; check its calibration",
        ),
        ({"window_m": 0.0}, "window_m = 0.0 m and size = 128; both have to be above 0"),
    ],
)
def test_what_it_refuses(change, message):
    arguments = {"masks": BLANK[None], "tool_positions": BOARD[None], "homography": H, "window_m": 0.64, "size": 128}
    with pytest.raises(InvalidInputError) as error:
        rectify(**{**arguments, **change})
    assert str(error.value) == message
