"""Outlines: everything of a solid lies within, and little else; shadows by similar triangles."""

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe.vision.silhouette import Solids, cast, fill, project, rims, silhouette

SIZE = 400
EYE = np.array([0.1, -0.2, 0.3])
PROJECTION = np.array([[500.0, 0, 200], [0, 500, 200], [0, 0, 1]]) @ np.column_stack([np.eye(3), -EYE])


def random_solid(rng, is_box):
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    centre = EYE + rng.uniform([-0.3, -0.3, 1.0], [0.3, 0.3, 2.0])
    return Solids(np.array([is_box]), rng.uniform(0.02, 0.15, (1, 3)), centre[None], axes[None])


def surface(solid, rng, n=4000):
    """Points on the solid's surface, (n, 3), world."""
    size = solid.sizes[0]
    if solid.is_box[0]:
        points = rng.uniform(-1, 1, (n, 3))
        on_face = rng.uniform(size=(n, 3)) < 0.6  # of one face, of two and so an edge, or of three and a corner
        on_face[np.arange(n), rng.integers(3, size=n)] = True
        points = np.where(on_face, np.sign(points), points)
        points *= size
    else:
        points = rng.normal(size=(n, 3))
        points *= size[0] / np.linalg.norm(points, axis=1, keepdims=True)
        points[:, 2] += np.sign(points[:, 2]) * size[1]
    return solid.centres[0] + points @ solid.axes[0].T


@pytest.mark.parametrize("is_box", [True, False])
@pytest.mark.parametrize("seed", range(10))
def test_an_outline_holds_the_solid_and_little_more(is_box, seed):
    rng = np.random.default_rng(seed)
    solid = random_solid(rng, is_box)
    picture = silhouette(solid, EYE, PROJECTION, SIZE)
    points = project(surface(solid, rng), PROJECTION)
    u, v = np.floor(points[((points >= 0) & (points < SIZE)).all(axis=1)]).astype(int).T
    # OpenCV fills a pixel whose middle lies within: one that is merely touched may be missing.
    assert (cv2.dilate(picture, np.ones((3, 3), np.uint8))[v, u] == 255).all()
    exact = np.zeros_like(picture)
    fill(exact, points, 255)
    more = cv2.dilate(exact, np.ones((5, 5), np.uint8))
    assert not ((picture > 0) & (more == 0)).any()


def test_a_thing_behind_the_camera_or_around_it_gives_finite_pixels():
    solids = Solids(
        np.array([True, False]), np.full((2, 3), 0.1), np.array([EYE - [0, 0, 1.0], EYE]), np.stack([np.eye(3)] * 2)
    )
    for rim in rims(solids, EYE + 1e-9):
        assert np.isfinite(project(rim, PROJECTION)).all()


def test_a_shadow_is_as_far_as_the_lamp_is_low():
    lamp = np.array([0.0, 0.0, 2.0])
    assert_allclose(cast(np.array([[0.3, 0.1, 0.01]]), lamp, 0.01), [[0.3, 0.1]])
    assert_allclose(cast(np.array([[0.3, -0.1, 1.0]]), lamp, 0.0), [[0.6, -0.2]])
