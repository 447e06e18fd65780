"""A plane seen from elsewhere: what lies in it comes out as the other camera sees it, what hides it is known."""

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError

pytest.importorskip("cv2")

import cv2
from tests.vision.rendered import D455, TARGET, looking, picture

from contactsafe.vision.lens import Lens
from contactsafe.vision.plane_view import PlaneView
from contactsafe.vision.rigid import pose_of
from contactsafe.vision.silhouette import Solids

FLAT = np.diag([1.0, 1.0, 0.0])
"""(x, y, 1) to (x, y, 0)."""

FROM_ABOVE = np.array([[1500.0, 0.0, 227.5], [0.0, -1500.0, 227.5], [0.0, 0.0, 1.0]])
"""The page's plane at 1500 pixels a metre."""

STANDS = [looking((0.35, 0.0, 0.5)), looking((-0.3, 0.3, 0.5), at=(0.05, 0.0, 0.0), roll=0.8)]


@pytest.mark.parametrize("stand", STANDS)
def test_the_target_is_seen_from_above_wherever_the_camera_stands(stand):
    view = PlaneView(D455, stand, FLAT, FROM_ABOVE, 455)
    found = TARGET.find(view.cut(picture(stand)))
    assert len(found.ids) > 20
    x, y, _ = TARGET.points(found.ids).T
    expected = np.column_stack([1500 * x + 227.5, 227.5 - 1500 * y]) - 0.5
    assert np.abs(found.pixels - expected).max() < 1.2
    assert (view.unseen == 0).all()


def test_a_tilted_plane_is_seen_as_it_is_tilted():
    tilt = 0.2
    plane = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [np.tan(tilt), 0.0, 0.02]])
    lying = pose_of(cv2.Rodrigues(np.array([0.0, -tilt, 0.0]))[0], [0.0, 0.0, 0.02])
    view = PlaneView(D455, lying @ STANDS[0], plane, FROM_ABOVE, 455)
    found = TARGET.find(view.cut(picture(STANDS[0])))
    x, y, _ = TARGET.points(found.ids).T
    expected = np.column_stack([1500 * x * np.cos(tilt) + 227.5, 227.5 - 1500 * y]) - 0.5
    assert np.abs(found.pixels - expected).max() < 1.2


def test_what_hides_the_plane_is_found_from_where_the_camera_stands():
    """A ball above the plane: every photograph's pixel whose ray meets it, and no other but at the rim."""
    stand, centre, radius = STANDS[1], np.array([0.03, 0.02, 0.12]), 0.03
    ball = Solids(np.array([False]), np.array([[radius, 1e-6, 0.0]]), centre[None], np.eye(3)[None])
    hidden = PlaneView(D455, stand, FLAT, FROM_ABOVE, 455).hidden(ball) > 0
    u, v = np.meshgrid(np.arange(455) + 0.5, np.arange(455) + 0.5)
    places = np.stack([(u - 227.5) / 1500, (227.5 - v) / 1500, np.zeros_like(u)], axis=-1)
    rays = places - stand[:3, 3]
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    passing = np.linalg.norm(np.cross(rays, centre - stand[:3, 3]), axis=-1)
    assert hidden[passing < 0.97 * radius].all()
    assert not hidden[passing > 1.12 * radius].any()
    assert hidden.sum() > 1000


def test_where_the_picture_ends_nothing_is_seen():
    aside = looking((0.3, 0.0, 0.3), at=(0.25, 0.3, 0.0))
    view = PlaneView(D455, aside, FLAT, FROM_ABOVE, 455)
    fraction = (view.unseen > 0).mean()
    assert 0.1 < fraction < 0.9
    away = Solids(np.array([True]), np.full((1, 3), 0.01), np.array([[-0.5, -2.0, 0.1]]), np.eye(3)[None])
    np.testing.assert_array_equal(view.hidden(away), view.unseen)
    white = view.cut(np.full((720, 1280, 3), 255, np.uint8))
    assert (white[view.unseen == 0] > 0).all()


def test_a_strongly_bent_lens_shows_nothing_twice():
    """Beyond the picture's corners the polynomials come back into the picture."""
    bent = Lens(640, 480, 500.0, 500.0, 320.0, 240.0, (-0.2, 0.0, 0.0, 0.0, 0.0))
    low = np.array([[60.0, 0.0, 227.5], [0.0, -60.0, 227.5], [0.0, 0.0, 1.0]])
    rows, columns = np.nonzero(PlaneView(bent, looking((0.0, 0.01, 0.5)), FLAT, low, 455).unseen == 0)
    aslant = np.hypot(rows - 227, columns - 227) / 60.0 / 0.5  # tangent of the angle from the camera's axis
    assert len(aslant) > 300
    assert aslant.max() < 1.3


def test_a_camera_that_looks_elsewhere_is_refused():
    for stand in (looking((0.3, 0.0, 0.5), at=(0.6, 0.0, 0.8)), looking((3.0, 0.0, 0.5), at=(5.0, 0.0, 0.0))):
        with pytest.raises(InvalidInputError, match="shows nothing of the plane; turn the camera to it"):
            PlaneView(D455, stand, FLAT, FROM_ABOVE, 455)
    with pytest.raises(InvalidInputError, match="homography is singular"):
        PlaneView(D455, STANDS[0], FLAT, np.zeros((3, 3)), 455)
