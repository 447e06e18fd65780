"""Ink found in pictures made by hand: by its darkness and sharp edge, whatever the light; nothing else."""

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.segment import Segmenter

N = 455
H = np.array([[1000.0, 0, 50], [0, 1000.0, 40], [0, 0, 1]])
CORNERS = np.array([[0, 0], [0.35, 0], [0.35, 0.37], [0, 0.37]])
"""A board from pixel 50 to 400 and from 40 to 410, of 1 mm pixels."""


@pytest.fixture(scope="module")
def segmenter():
    return Segmenter(H, CORNERS)


def board(level=200.0, noise=2.0, seed=0):
    """A grey picture of a board on a darker table, float."""
    picture = np.full((N, N), 0.5 * level)
    picture[40:410, 50:400] = level
    return picture + np.random.default_rng(seed).normal(0.0, noise, (N, N))


def photo(picture, tint=(1.0, 1.0, 1.0)):
    return np.clip(picture[..., None] * tint, 0, 255).astype(np.uint8)


def written(picture, darkness=0.8, thickness=7):
    """The picture with a line of a pen drawn on it, and where."""
    where = np.zeros((N, N), np.uint8)
    cv2.polylines(where, [np.array([[100, 100], [180, 220], [260, 120], [340, 330]])], False, 255, thickness)
    return picture * (1 - darkness * where / 255), where


def expected(where):
    return cv2.resize(where, (128, 128), interpolation=cv2.INTER_AREA) > 255 * 0.10


def agreement(mask, where):
    found, there = mask == 0, expected(where)
    return (found & there).sum() / (found | there).sum()


@pytest.mark.parametrize("level", [60.0, 120.0, 230.0])
@pytest.mark.parametrize("noise", [0.0, 2.0, 5.0])
def test_a_clean_board_is_blank(segmenter, level, noise):
    assert (segmenter.segment(photo(board(level, noise))) == 255).all()


@pytest.mark.parametrize("darkness", [0.35, 0.6, 0.9])
def test_a_line_is_found_in_its_place(segmenter, darkness):
    picture, where = written(board(), darkness)
    mask = segmenter.segment(photo(picture))
    assert mask.dtype == np.uint8
    assert set(np.unique(mask)) == {0, 255}
    assert agreement(mask, where) > 0.85


def test_brightness_and_tint_of_the_light_change_next_to_nothing(segmenter):
    picture, where = written(board(noise=0.0))
    for scale, tint in ((0.4, (1, 1, 1)), (1.0, (1.0, 0.85, 0.7)), (0.7, (0.8, 0.9, 1.0))):
        assert agreement(segmenter.segment(photo(scale * picture, tint)), where) > 0.85


@pytest.mark.parametrize("channel", range(3))
def test_ink_of_any_colour_is_ink(segmenter, channel):
    """A pen that takes light from one channel alone."""
    clean = board()
    picture, where = written(clean)
    planes = [picture if k == channel else clean for k in range(3)]
    assert agreement(segmenter.segment(np.clip(np.stack(planes, -1), 0, 255).astype(np.uint8)), where) > 0.85


def test_the_scale_of_a_homography_means_nothing(segmenter):
    picture = photo(written(board())[0])
    for scale in (-1.0, 0.01):
        assert_array_equal(Segmenter(scale * H, CORNERS).segment(picture), segmenter.segment(picture))


def test_a_grey_picture_does_as_well(segmenter):
    picture, where = written(board())
    assert agreement(segmenter.segment(photo(picture)[..., 0]), where) > 0.85


def test_a_slope_of_light_and_a_soft_shadow_are_not_ink(segmenter):
    light = np.linspace(1.0, 0.5, N)[None] * np.ones((N, 1))
    shadow = np.ones((N, N))
    cv2.circle(shadow, (230, 200), 60, 0.55, -1)
    light *= cv2.GaussianBlur(shadow, (0, 0), 4.0)
    assert (segmenter.segment(photo(board() * light)) == 255).all()
    picture, where = written(board())
    assert agreement(segmenter.segment(photo(picture * light)), where) > 0.8


def test_what_covers_more_than_the_window_is_ink_too(segmenter):
    picture, where = board(), np.zeros((N, N), np.uint8)
    where[100:250, 120:300] = 255
    assert agreement(segmenter.segment(photo(np.where(where > 0, 25.0, picture))), where) > 0.95


def test_nothing_is_looked_for_where_the_arm_stands_and_off_the_board(segmenter):
    picture, where = written(board())
    hidden = np.zeros((N, N), np.uint8)
    hidden[90:200, 60:390] = 255
    picture[hidden > 0] = np.random.default_rng(1).uniform(0, 255, (hidden > 0).sum())  # anything at all
    picture[5:30, 5:30], picture[430:450, 60:70] = 0.0, 0.0
    mask = segmenter.segment(photo(picture), hidden)
    where[hidden > 0] = 0
    found = mask == 0
    assert not (found & (cv2.resize(hidden, (128, 128), interpolation=cv2.INTER_AREA) == 255)).any()
    assert agreement(mask, where) > 0.8
    assert not (found & ~cv2.dilate(expected(where).astype(np.uint8), np.ones((3, 3))).astype(bool)).any()


def test_ink_beside_the_arm_is_ink_where_it_goes_on_further_inside(segmenter):
    """The arm's own dark edge beside its outline, where the camera is some pixels off, was taken for ink."""
    hidden, blob, stroke = np.zeros((N, N), np.uint8), np.zeros((N, N)), np.zeros((N, N))
    hidden[100:200] = 255
    blob[200:205, 100:140] = stroke[204:260, 200:206] = 1.0
    edge, line = ((segmenter.segment(photo(board() * (1 - 0.8 * what)), hidden)) == 0 for what in (blob, stroke))
    assert not edge.any()
    assert np.flatnonzero(line.any(axis=1)).min() * N / 128 < 206


def test_what_the_arm_hides_is_not_beside_it(segmenter):
    hidden = np.zeros((N, N), np.uint8)
    assert segmenter.beside(hidden).all()
    hidden[: N // 2] = 255
    beside = segmenter.beside(hidden)
    size = segmenter.mask_size
    assert not beside[: size // 2].any()
    assert beside[size // 2 + 4 :].all()


def test_with_all_hidden_nothing_is_found(segmenter):
    assert (segmenter.segment(photo(written(board())[0]), np.full((N, N), 255, np.uint8)) == 255).all()


def test_a_picture_is_left_as_it_was(segmenter):
    picture, hidden = photo(written(board())[0]), np.zeros((N, N), np.uint8)
    before = picture.copy()
    segmenter.segment(picture, hidden)
    assert_array_equal(picture, before)
    assert not hidden.any()


@pytest.mark.parametrize(
    ("picture", "hidden", "text"),
    [
        (np.zeros((N, N, 4), np.uint8), None, "photo is uint8 of shape (455, 455, 4); give uint8 (455, 455, 3)"),
        (np.zeros((N, N, 3)), None, "photo is float64 of shape (455, 455, 3); give uint8 (455, 455, 3)"),
        (
            np.zeros((N, N, 3), np.uint8),
            np.zeros((128, 128), np.uint8),
            "hidden is uint8 of shape (128, 128); give uint8 (455, 455)",
        ),
    ],
)
def test_other_pictures_are_refused(segmenter, picture, hidden, text):
    with pytest.raises(InvalidInputError) as caught:
        segmenter.segment(picture, hidden)
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("homography", "corners", "sizes", "text"),
    [
        (
            np.full((3, 3), np.nan), CORNERS, {},
            "homography has shape (3, 3) and corners (4, 2); give finite (3, 3) and (4, 2)",
        ),
        (H, CORNERS[:3], {}, "homography has shape (3, 3) and corners (3, 2); give finite (3, 3) and (4, 2)"),
        (H, CORNERS, {"mask_size": 0}, "photo_size = 455, mask_size = 0; give 8 or more pixels"),
        (H, CORNERS + 9.0, {}, "the homography shows no board in the photograph; calibrate the camera anew"),
    ],
)  # fmt: skip
def test_cameras_that_cannot_be_are_refused(homography, corners, sizes, text):
    with pytest.raises(InvalidInputError) as caught:
        Segmenter(homography, corners, **sizes)
    assert str(caught.value) == text


@pytest.mark.parametrize(("darkness", "thickness"), [(0.2, 3), (0.15, 3), (0.12, 4), (0.6, 1), (0.4, 1)])
def test_faint_and_thin_strokes_were_missed(segmenter, darkness, thickness):
    picture, where = written(board(noise=3.0), darkness, thickness)
    found = segmenter.segment(photo(cv2.GaussianBlur(picture, (0, 0), 0.8))) == 0
    there = cv2.resize(where, (128, 128), interpolation=cv2.INTER_AREA) > 255 * 0.10
    around = np.ones((3, 3), np.uint8)
    assert (there & (cv2.dilate(found.astype(np.uint8), around) > 0)).sum() > 0.97 * there.sum()
    assert (found & (cv2.dilate(there.astype(np.uint8), around) == 0)).sum() == 0


@pytest.mark.parametrize("gain", [30.0, 60.0, 100.0])
@pytest.mark.parametrize("gap", [4, 8, 14])
def test_the_gap_between_two_reflections_is_no_line(segmenter, gap, gain):
    lamps = np.zeros((N, N))
    lamps[100:360, 200 - gap // 2 - 8 : 200 - gap // 2] = 1.0
    lamps[100:360, 200 + gap // 2 : 200 + gap // 2 + 8] = 1.0
    for blur in (1.5, 3.0, 6.0):
        lit = board(180.0, 3.0) + gain * cv2.GaussianBlur(lamps, (0, 0), blur)
        assert (segmenter.segment(photo(lit)) == 255).all()


def test_the_dark_edge_of_a_picture_that_was_straightened_is_no_line():
    H_all = np.array([[1500.0, 0, -50], [0, 1500.0, -40], [0, 0, 1]])  # the board is larger than the picture
    picture = np.full((N, N), 180.0)
    picture[:, :2] = 158.0
    assert (Segmenter(H_all, CORNERS).segment(photo(picture)) == 255).all()


@pytest.mark.parametrize("offset", [0, 6, 12, 25])
def test_beside_the_arm_in_its_own_shadow_is_no_line(segmenter, offset):
    arm, shadow = np.zeros((N, N), np.uint8), np.zeros((N, N))
    arm[30:200, 180:240] = 255  # it reaches over the board's edge
    shadow[20 : 200 + offset, 180 + offset : 250 + offset] = 1.0
    picture = board(noise=3.0) * (1.0 - 0.35 * cv2.GaussianBlur(shadow, (0, 0), 6.0))
    picture = cv2.GaussianBlur(np.where(arm > 0, 40.0, picture), (0, 0), 1.2)
    assert (segmenter.segment(photo(picture), arm) == 255).all()
