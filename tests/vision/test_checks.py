"""What users hand over beside pictures: taken in any form that says the same, refused where it says nothing."""

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.checks import checked_homography, checked_tools

H = np.array([[200.0, 3.0, 60.0], [-2.0, 180.0, 70.0], [0.01, 0.2, 1.0]])


@pytest.mark.parametrize("form", [np.asarray, np.asfortranarray, np.ndarray.tolist, lambda H: H.astype(np.float32)])
def test_a_homography_is_taken_in_any_form(form):
    taken = checked_homography(form(H))
    np.testing.assert_allclose(taken, H, rtol=1e-6)
    assert taken.dtype == np.float64
    assert taken.flags.c_contiguous


@pytest.mark.parametrize("scale", [1e-9, -1.0, 1e9])
def test_the_scale_of_a_homography_is_no_reason_to_refuse_it(scale):
    np.testing.assert_allclose(checked_homography(scale * H), scale * H)


@pytest.mark.parametrize("given", [None, np.eye(2), np.full((3, 3), np.nan), np.diag([1.0, np.inf, 1.0])])
def test_what_is_no_homography_is_refused(given):
    with pytest.raises(InvalidInputError, match="give a finite"):
        checked_homography(given)


@pytest.mark.parametrize("given", [np.zeros((3, 3)), np.ones((3, 3)), np.diag([1.0, 1.0, 0.0])])
def test_a_camera_that_sees_a_plane_edge_on_is_refused(given):
    with pytest.raises(InvalidInputError, match="homography is singular"):
        checked_homography(given)


@pytest.mark.parametrize("width", [2, 3, 6])
def test_of_tools_x_and_y_are_read_whatever_follows(width):
    positions = np.arange(4.0 * width).reshape(4, width)
    np.testing.assert_array_equal(checked_tools(positions, 4), positions[:, :2])
    np.testing.assert_array_equal(checked_tools(positions.tolist(), 4), positions[:, :2])


@pytest.mark.parametrize("shape", [(3, 2), (5, 2), (4, 1), (4,), (4, 2, 1)])
def test_another_number_of_tools_than_of_masks_is_refused(shape):
    with pytest.raises(InvalidInputError, match="give one row of x, y for each of 4 masks"):
        checked_tools(np.zeros(shape), 4)
