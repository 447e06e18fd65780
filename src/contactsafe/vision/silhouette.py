"""Where capsules and boxes stand in a picture, from a camera's place or a lamp's: the hulls of their rims."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsafe.vision.opencv import cv2

_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_TURN = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_TURN), np.sin(_TURN)]) / np.cos(np.pi / len(_TURN))  # around the round circle
_SUBPIXEL = 4  # bits
_NEAR = 0.05  # m: what is closer to the camera's plane, or behind it, is drawn as if it were here


class Solids(NamedTuple):
    """Capsules and boxes, as MuJoCo's geoms are given.

    Attributes:
        is_box: (k,) bool; the others are capsules along their z axes.
        sizes: (k, 3), m: half edges of a box; radius and half length of a capsule's axis, then anything.
        centres: world, (k, 3), m.
        axes: each solid's axes in the world as columns, (k, 3, 3).
    """

    is_box: np.ndarray
    sizes: np.ndarray
    centres: np.ndarray
    axes: np.ndarray


def rims(solids: Solids, eye: np.ndarray) -> np.ndarray:
    """Find points in space whose hull, from where the eye is, covers each solid; a shade more for what is round.

    Args:
        solids: k of them.
        eye: (3,), world, m.

    Returns:
        Points, (k, m, 3), world, m.
    """
    corners = solids.centres[:, None] + (_CORNERS * solids.sizes[:, None]) @ solids.axes.transpose(0, 2, 1)
    halves = solids.sizes[:, 1, None] * solids.axes[:, :, 2]
    ends = solids.centres[:, None] + np.stack([-halves, halves], axis=1)
    round_rims = _rims_of_spheres(ends, solids.sizes[:, :1], eye).reshape(len(ends), -1, 3)
    corners = np.tile(corners, (1, round_rims.shape[1] // len(_CORNERS), 1))
    return np.where(solids.is_box[:, None, None], corners, round_rims)


def _rims_of_spheres(centres: np.ndarray, radii: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Return points around the circles in which rays from an eye touch spheres, (k, 2, m, 3), for centres (k, 2, 3)."""
    rays = centres - eye
    distances = np.linalg.norm(rays, axis=-1)
    fractions = np.minimum((radii / distances) ** 2, 0.99)
    sideways = np.cross(rays, np.where(np.abs(rays[..., :1]) < 0.5 * distances[..., None], *np.eye(3)[:2]))
    sideways /= np.linalg.norm(sideways, axis=-1, keepdims=True)
    across = np.cross(rays / distances[..., None], sideways)
    middles, circles = centres - fractions[..., None] * rays, radii * np.sqrt(1 - fractions)
    directions = _CIRCLE[:, :1] * sideways[..., None, :] + _CIRCLE[:, 1:] * across[..., None, :]
    return middles[..., None, :] + circles[..., None, None] * directions


def project(points: np.ndarray, projection: np.ndarray) -> np.ndarray:
    """Give the pixels, (..., 2), of points in space.

    Args:
        points: (..., 3), world, m.
        projection: (3, 4) of a camera, its last row the depth in m.
    """
    seen = points @ projection[:, :3].T + projection[:, 3]
    return seen[..., :2] / np.maximum(seen[..., 2:], _NEAR)


def cast(points: np.ndarray, lamp: np.ndarray, z: float) -> np.ndarray:
    """Give where the shadows of points, (..., 3), fall on the plane at height z, (..., 2), m; the lamp is above."""
    below = np.maximum(lamp[2] - points[..., 2:], _NEAR)
    return lamp[:2] + (points[..., :2] - lamp[:2]) * ((lamp[2] - z) / below)


def on_plane(points: np.ndarray, homography: np.ndarray) -> np.ndarray:
    """Give the pixels, (..., 2), of points (..., 2), m, of the plane that a homography, (3, 3), belongs to."""
    seen = points @ homography[:, :2].T + homography[:, 2]
    return seen[..., :2] / seen[..., 2:]


def fill(picture: np.ndarray, pixels: np.ndarray, value: float | Sequence[float]) -> None:
    """Fill the hull of points.

    Args:
        picture: (n, n) or (n, n, 3), of a type OpenCV draws on; updated.
        pixels: (m, 2), columns and rows; the middle of pixel (0, 0) is (0.5, 0.5).
        value: a number, or three.
    """
    fixed = np.rint((pixels - 0.5) * 2**_SUBPIXEL).astype(np.int32)
    cv2.fillConvexPoly(picture, cv2.convexHull(fixed), value, shift=_SUBPIXEL)


def silhouette(solids: Solids, eye: np.ndarray, projection: np.ndarray, size: int) -> np.ndarray:
    """Draw what hides the board: 255 where any solid stands, 0 elsewhere.

    Args:
        solids: of the arm.
        eye: the camera's place, (3,), world, m.
        projection: its (3, 4).
        size: pixels along an edge.

    Returns:
        uint8, (size, size).
    """
    picture = np.zeros((size, size), np.uint8)
    for outline in project(rims(solids, eye), projection):
        fill(picture, outline, 255)
    return picture
