"""Checks of what users hand over beside pictures: where the tools are, and how a camera sees the plane."""

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError


def checked_tools(tool_positions: ArrayLike, count: int) -> np.ndarray:
    """Return x and y of the tools, (N, 2), m.

    Args:
        tool_positions: (N, 2) or wider, world, m.
        count: N, number of masks.

    Raises:
        InvalidInputError: there are fewer or more, or no y.
    """
    tool_xy = np.asarray(tool_positions, dtype=np.float64)
    if tool_xy.ndim != 2 or len(tool_xy) != count or tool_xy.shape[1] < 2:
        raise InvalidInputError(
            f"tool_positions have shape {tool_xy.shape}; give one row of x, y for each of {count} masks"
        )
    return np.ascontiguousarray(tool_xy[:, :2])


def checked_homography(homography: ArrayLike | None) -> np.ndarray:
    """Return a homography, (3, 3), row-major, and float64.

    Raises:
        InvalidInputError: it is not finite (3, 3), or cannot be inverted.
    """
    H = np.ascontiguousarray(homography, dtype=np.float64)
    if H.shape != (3, 3) or not np.isfinite(H).all():
        raise InvalidInputError(f"homography has shape {H.shape}; give a finite (3, 3) matrix")
    norm = np.linalg.norm(H)
    if norm == 0.0 or abs(np.linalg.det(H / norm)) < 1e-15:
        raise InvalidInputError("homography is singular: the camera would see the board edge-on; check its calibration")
    return H
