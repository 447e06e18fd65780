"""Poses as matrices, (4, 4), and the one that lays points on points; `pose_a_b` gives b's frame in a's."""

from typing import NamedTuple

import numpy as np

from contactsafe.core.errors import InvalidInputError

_FLATTEST = 0.05
"""Least extent of points across the line that they lie along, as a fraction of their extent along it."""


class Fit(NamedTuple):
    """A rigid transform between points.

    Attributes:
        pose: that takes the first points to the second, (4, 4).
        residual_m: root mean square of the distances that remain, m.
    """

    pose: np.ndarray
    residual_m: float


def pose_of(rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Put a rotation, (3, 3), and a position, (3,), m, together, (4, 4)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, np.ravel(position)
    return pose


def inverse(pose: np.ndarray) -> np.ndarray:
    """Return the inverse of poses, (..., 4, 4)."""
    turned = np.swapaxes(pose[..., :3, :3], -1, -2)
    out = np.zeros_like(pose)
    out[..., :3, :3], out[..., 3, 3] = turned, 1.0
    out[..., :3, 3] = -np.einsum("...ij,...j->...i", turned, pose[..., :3, 3])
    return out


def moved(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Give points, (..., 3), m, of a pose's frame in the frame that the pose is in."""
    return points @ pose[:3, :3].T + pose[:3, 3]


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """Return the rotation nearest to a matrix, (3, 3), in the Frobenius norm: the orthogonal Procrustes problem."""
    U, _, Vt = np.linalg.svd(matrix)
    return U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt


def angles(rotations: np.ndarray) -> np.ndarray:
    """Return by how much rotations, (..., 3, 3), turn, (...), rad; accurate near 0."""
    away = np.linalg.norm(rotations - np.eye(3), axis=(-2, -1)) / np.sqrt(8.0)
    return 2.0 * np.arcsin(np.minimum(away, 1.0))


def fit_rigid(points: np.ndarray, measured: np.ndarray) -> Fit:
    """Find the rotation and translation that take points to where they were measured, in the least squares' sense.

    Arun, Huang and Blostein 1987, with the sign of Umeyama 1991, so that it is never a reflection.

    Args:
        points, measured: (n, 3) each, n ≥ 3, m.

    Raises:
        InvalidInputError: fewer than three points, or points along one line.
    """
    points, measured = np.asarray(points, dtype=float), np.asarray(measured, dtype=float)
    if points.shape != measured.shape or points.ndim != 2 or len(points) < 3 or points.shape[1] != 3:
        raise InvalidInputError(f"points are {points.shape} and {measured.shape}; give three or more on either side")
    for each in (points, measured):
        extent = np.linalg.svd(each - each.mean(axis=0), compute_uv=False)
        if not extent[1] > _FLATTEST * extent[0]:
            raise InvalidInputError(
                f"points lie along one line, {1000 * extent[1]:.1f} mm across and {1000 * extent[0]:.1f} mm along it; "
                "take points that span a triangle"
            )
    from_middle, to_middle = points.mean(axis=0), measured.mean(axis=0)
    R = nearest_rotation((measured - to_middle).T @ (points - from_middle))
    pose = pose_of(R, to_middle - R @ from_middle)
    return Fit(pose, float(np.sqrt(((moved(pose, points) - measured) ** 2).sum(axis=1).mean())))
