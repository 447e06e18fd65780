"""Log-polar features: where ink is from here, however little of it, whatever camera looks."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from tests.learning.fakes import BOARD, camera_homography

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.wiping.board import Camera
from contactsafe.tasks.wiping.camera import plane_homography
from contactsafe.vision.log_polar import FEATURES, RINGS, SCALES_M, SECTORS, ground_of, log_polar_features

H = camera_homography()
GROUND = ground_of(H, (128, 128))
GRID = RINGS * SECTORS
places = st.tuples(st.floats(-0.14, 0.14), st.floats(-0.14, 0.14))


def mask_of(*points):
    mask = np.full((1, 128, 128), 255, np.uint8)
    for point in points:
        u, v, w = H @ [*(BOARD + point), 1.0]
        mask[0, int(v / w), int(u / w)] = 0
    return mask


def look(mask, tool=(0.0, 0.0)):
    return log_polar_features(mask, (BOARD + tool)[None], GROUND)[0]


def patch(picture, k):
    """Vector to the patch about the nearest ink at the k-th scale, m."""
    x, y, distance = picture[GRID + 4 * k : GRID + 4 * k + 3]
    length = np.hypot(x, y)
    return 0.1 * distance * np.array([x, y]) / max(length, 1e-9)


def test_no_ink_no_numbers():
    assert not look(mask_of()).any()
    assert len(look(mask_of())) == FEATURES


@given(places, places)
def test_a_single_pixel_anywhere_is_seen_and_placed_within_its_own_size(speck, tool):
    picture = look(mask_of(speck), tool)
    away = np.subtract(speck, tool)
    assert picture[:GRID].sum() > 0.3
    for k in range(len(SCALES_M)):
        assert np.linalg.norm(patch(picture, k) - away) < 0.005


@given(places, places, places)
def test_the_finest_scale_says_the_nearest(first, second, tool):
    near, far = sorted((np.subtract(p, tool) for p in (first, second)), key=np.linalg.norm)
    if np.linalg.norm(far) > np.linalg.norm(near) + 0.05:
        found = patch(look(mask_of(first, second), tool), 0)
        assert np.linalg.norm(found - near) < 0.01


@given(st.floats(0.0, 2 * np.pi), st.floats(0.06, 0.12))
def test_between_two_patches_as_far_away_it_says_one_of_them(angle, distance):
    """Their mean lies under the tool, where there is nothing: who believed it would stay there."""
    either = distance * np.array([np.cos(angle), np.sin(angle)])
    picture = look(mask_of(either, -either))
    for k in (0, 1):
        found = patch(picture, k)
        assert min(np.linalg.norm(found - either), np.linalg.norm(found + either)) < 0.01


def test_the_grid_turns_with_the_ink():
    """A quarter turn about the tool is a quarter of the sectors on."""
    east, north = (look(mask_of(p))[:GRID].reshape(RINGS, SECTORS) for p in ((0.1, 0.0), (0.0, 0.1)))
    assert np.argmax(np.roll(east.sum(0), SECTORS // 4)) == np.argmax(north.sum(0))


@given(places)
def test_more_ink_is_more(tool):
    little, much = mask_of((0.05, 0.05)), mask_of((0.05, 0.05), (-0.05, 0.1), (0.1, -0.1))
    assert (look(much, tool)[:GRID] >= look(little, tool)[:GRID]).all()
    assert look(much, tool)[-1] > look(little, tool)[-1]


@given(places, places)
def test_another_camera_sees_ink_in_the_same_place(speck, tool):
    """One that stands to the side and nearer, with its own calibration."""
    aside = plane_homography(Camera(position=(0.8, -0.6, 0.6)), 0.01)
    u, v, w = aside @ [*(BOARD + speck), 1.0]
    mask = np.full((1, 128, 128), 255, np.uint8)
    mask[0, int(v / w), int(u / w)] = 0
    other = log_polar_features(mask, (BOARD + tool)[None], ground_of(aside, (128, 128)))[0]
    assert np.linalg.norm(patch(other, 0) - patch(look(mask_of(speck), tool), 0)) < 0.01


def test_area_of_a_pixel_is_that_of_its_outline_on_the_board():
    """By the shoelace formula over the corners of a pixel taken back to the board."""
    v, u = 40, 90
    corners = np.array([[u, v, 1], [u + 1, v, 1], [u + 1, v + 1, 1], [u, v + 1, 1]]) @ np.linalg.inv(H).T
    x, y = (corners[:, :2] / corners[:, 2:]).T
    outline = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
    assert GROUND.area[v * 128 + u] == pytest.approx(outline, rel=1e-3)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_threads_see_the_same(n):
    rng = np.random.default_rng(n)
    masks = np.where(rng.random((n, 128, 128)) < 0.01, 0, 255).astype(np.uint8)
    tools = BOARD + rng.uniform(-0.1, 0.1, (n, 2))
    with ThreadPoolExecutor(2) as threads:
        assert_array_equal(log_polar_features(masks, tools, GROUND, threads), log_polar_features(masks, tools, GROUND))
        with pytest.raises(InvalidInputError, match=f"one row of x, y for each of {n} masks"):
            log_polar_features(masks, np.zeros((n + 1, 2)), GROUND, threads)


def test_what_cannot_be_looked_at_is_refused():
    with pytest.raises(InvalidInputError) as error:
        log_polar_features(np.zeros((1, 64, 64), np.uint8), BOARD[None], GROUND)
    assert str(error.value) == "masks are uint8 of shape (1, 64, 64); give uint8 of 16384 pixels each"
    with pytest.raises(InvalidInputError) as error:
        log_polar_features(mask_of(), np.zeros((2, 2)), GROUND)
    assert str(error.value) == "tool_positions have shape (2, 2); give one row of x, y for each of 1 masks"
    with pytest.raises(InvalidInputError) as error:
        ground_of(np.ones((3, 3)), (128, 128))
    assert str(error.value) == ("homography is singular: the camera would see the board edge-on; check its calibration")
    with pytest.raises(InvalidInputError) as error:
        ground_of(np.ones((2, 3)), (128, 128))
    assert str(error.value) == "homography has shape (2, 3); give a finite (3, 3) matrix"
