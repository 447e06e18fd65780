"""A lens and its undoing: what is straight in the world is straight in the photograph."""

import types

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError

pytest.importorskip("cv2")

from contactsafe.vision.lens import Distorted, Lens, Square

D455 = Lens(1280, 720, 639.0, 639.0, 639.5, 359.5, (-0.056, 0.065, 0.0, 0.0, 0.0))


def pattern(size=455):
    """Draw smooth spots, so that sampling twice loses little."""
    v, u = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    grey = 128 + 80 * np.sin(u / 20.0) * np.cos(v / 25.0)
    return np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)


def test_a_picture_through_the_lens_and_back_is_the_photograph():
    square = Square(D455, 455, 639.0)
    back = square.cut(Distorted(square).picture(pattern()))
    inner = (slice(4, -4), slice(4, -4), slice(None))
    away = np.abs(back.astype(int) - pattern().astype(int))[inner]
    assert away.mean() < 1.0
    assert away.max() < 12


def test_without_undistortion_the_corners_are_pixels_away():
    """The check that the test above is one of the lens: a plain crop of the same picture is not the photograph."""
    square = Square(D455, 455, 639.0)
    picture = Distorted(square).picture(pattern())
    crop = picture[132 : 132 + 455, 412 : 412 + 455]
    away = np.abs(crop.astype(int) - pattern().astype(int))
    assert away[:40, :40].mean() > 3.0


def test_a_picture_of_another_size_is_refused_in_one_line():
    with pytest.raises(InvalidInputError, match=r"give uint8 \(720, 1280, 3\)"):
        Square(D455, 455, 639.0).cut(np.zeros((480, 640, 3), np.uint8))


@pytest.mark.parametrize("change", [{"fx": 0.0}, {"width": 4}, {"cx": np.nan}, {"distortion": (np.inf, 0, 0, 0, 0)}])
def test_what_is_no_lens_is_refused(change):
    known = {"width": 1280, "height": 720, "fx": 640.0, "fy": 640.0, "cx": 640.0, "cy": 360.0}
    with pytest.raises(InvalidInputError, match="lens"):
        Lens(**{**known, **change})


def test_a_device_says_its_lens_as_librealsense_does():
    known = types.SimpleNamespace(
        width=1280, height=720, fx=1.5, fy=2.5, ppx=3.0, ppy=4.0, coeffs=[0.1, 0.2, 0.3, 0.4, 0.5]
    )
    assert Lens.of_realsense(known) == Lens(1280, 720, 1.5, 2.5, 3.0, 4.0, (0.1, 0.2, 0.3, 0.4, 0.5))


def test_a_camera_turned_about_its_axis_sees_the_photograph_turned():
    quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    lens = Lens(721, 721, 639.0, 639.0, 360.0, 360.0)
    square = Square(lens, 455, 639.0)
    straight, turned = (square.cut(Distorted(square, axes).picture(pattern())) for axes in (None, quarter))
    away = np.abs(np.rot90(straight).astype(int) - turned.astype(int))[3:-3, 3:-3]
    other = np.abs(np.rot90(straight, -1).astype(int) - turned.astype(int))[3:-3, 3:-3]
    assert min(away.mean(), other.mean()) < 1.0
    assert max(away.mean(), other.mean()) > 10.0
