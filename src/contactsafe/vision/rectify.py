"""The camera's mask, shown in the tool's frame.

A fixed camera sees the board at an angle; the policy asks where ink is relative to the pad. Both are planes, so one
homography and the tool's position take the one to the other. With it a small network learns to wipe in minutes; from
the camera's own frame it hardly does.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.compiled import compiled
from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.checks import checked_homography, checked_tools

INK_BELOW = 128
"""A camera pixel darker than this is ink; masks hold 0 and 255 only."""

WINDOW_M = 0.64
"""Side of the square shown around the tool, m: over twice the ink area, so all ink is in view wherever the tool is."""

SIZE = 128
"""Cells along a side of the view; 5 mm each with the default window."""


def rectify(
    masks: ArrayLike,
    tool_positions: ArrayLike,
    homography: ArrayLike | None,
    window_m: float = WINDOW_M,
    size: int = SIZE,
) -> np.ndarray:
    """Show each camera mask in a board-aligned window centred on its tool.

    Cell (row, column) covers a square of window_m / size; columns run along world x and rows along world y:
    `x = tool_x + ((column + 1/2) / size - 1/2) window_m`, likewise y with row. A cell is ink if the camera pixel at its
    centre is ink, or if the centre of any ink pixel falls into it. So strokes have no holes where the camera sees
    finely, and a speck of a single pixel is never lost where it sees coarsely.

    Args:
        masks: camera masks, (N, height, width) or (N, height, width, 1), uint8: 0 is ink, 255 all else.
        tool_positions: tool points in world, (N, 2) or (N, 3) or wider, m; only x and y are read.
        homography: board plane (x, y, 1) in m to homogeneous pixels (u = column, v = row, w), (3, 3). Pixel centres lie
            at integer + 0.5.
        window_m: side of the window, m.
        size: cells along a side.

    Returns:
        Views, (N, size, size), uint8: 0 is ink, 255 is no ink or out of the camera's view.

    Raises:
        InvalidInputError: a shape or type differs from the above, or the homography cannot be inverted.
    """
    masks = _checked_masks(masks)
    tool_xy, H = checked_tools(tool_positions, len(masks)), checked_homography(homography)
    if not (window_m > 0.0 and size > 0):
        raise InvalidInputError(f"window_m = {window_m} m and size = {size}; both have to be above 0")
    views = np.empty((masks.shape[0], size, size), dtype=np.uint8)
    _rectify(masks, tool_xy, H, np.linalg.inv(H), float(window_m), views)
    return views


def _checked_masks(masks: ArrayLike) -> np.ndarray:
    """Return the masks without a channel, (N, height, width)."""
    masks = np.asarray(masks)
    if masks.ndim == 4 and masks.shape[3] == 1:
        masks = masks[..., 0]
    if masks.ndim != 3 or masks.dtype != np.uint8:
        raise InvalidInputError(
            f"masks are {masks.dtype} of shape {masks.shape}; give uint8 of shape (N, height, width)"
        )
    return np.ascontiguousarray(masks)


@compiled(nogil=True)
def _rectify(masks, tool_xy, homography, inverse, window_m, views):
    for n in range(masks.shape[0]):
        _rectify_one(masks[n], tool_xy[n, 0], tool_xy[n, 1], homography, inverse, window_m, views[n])


@compiled(nogil=True)
def _rectify_one(mask, tool_x, tool_y, H, H_inv, window_m, view):
    size = view.shape[0]
    view[:, :] = 255
    top, bottom, left, right = _ink_box(mask)
    if bottom < 0 or not (math.isfinite(tool_x) and math.isfinite(tool_y)):
        return
    # In front of the camera, w has the sign of what the image centre looks at.
    centre_w = H_inv[2, 0] * 0.5 * mask.shape[1] + H_inv[2, 1] * 0.5 * mask.shape[0] + H_inv[2, 2]
    side = 1.0 if centre_w > 0.0 else -1.0
    per_m = size / window_m
    x0 = tool_x - 0.5 * window_m
    y0 = tool_y - 0.5 * window_m
    _splat(mask, top, bottom, left, right, H_inv, side, x0, y0, per_m, view)

    first_row, last_row, first_column, last_column = _cells_that_see(
        top, bottom, left, right, H_inv, side, x0, y0, per_m, size
    )
    _look_up(mask, first_row, last_row, first_column, last_column, H, side, x0, y0, per_m, view)


@compiled(nogil=True)
def _cells_that_see(top, bottom, left, right, H_inv, side, x0, y0, per_m, size):
    """Find rows and columns of the cells that can see ink: they lie within the outline of its box on the board."""
    low_row, high_row, low_column, high_column = math.inf, -math.inf, math.inf, -math.inf
    for corner in range(4):
        u = float(left if corner % 2 == 0 else right + 1)
        v = float(top if corner < 2 else bottom + 1)
        w = side * (H_inv[2, 0] * u + H_inv[2, 1] * v + H_inv[2, 2])
        if w <= 1e-12:  # the box reaches the horizon: look everywhere
            low_row, high_row, low_column, high_column = 0.0, size, 0.0, size
            break
        column = (side * (H_inv[0, 0] * u + H_inv[0, 1] * v + H_inv[0, 2]) / w - x0) * per_m
        row = (side * (H_inv[1, 0] * u + H_inv[1, 1] * v + H_inv[1, 2]) / w - y0) * per_m
        low_row, high_row = min(low_row, row), max(high_row, row)
        low_column, high_column = min(low_column, column), max(high_column, column)
    first_row, last_row = _clamp(low_row - 1.0, size), _clamp(high_row + 2.0, size)
    return first_row, last_row, _clamp(low_column - 1.0, size), _clamp(high_column + 2.0, size)


@compiled(nogil=True)
def _clamp(value, size):
    return int(min(max(value, 0.0), float(size)))


@compiled(nogil=True)
def _ink_box(mask):
    """Find rows and columns between which all ink lies, both ends included; bottom is -1 without ink."""
    top, bottom, left, right = mask.shape[0], -1, mask.shape[1], -1
    for v in range(mask.shape[0]):
        darkest = 255
        for u in range(mask.shape[1]):
            darkest = min(darkest, mask[v, u])
        if darkest >= INK_BELOW:
            continue
        top = min(top, v)
        bottom = v
        for u in range(mask.shape[1]):
            if mask[v, u] < INK_BELOW:
                left = min(left, u)
                right = max(right, u)
    return top, bottom, left, right


@compiled(nogil=True)
def _splat(mask, top, bottom, left, right, H_inv, side, x0, y0, per_m, view):
    """Mark the cell that holds the centre of each ink pixel."""
    size = view.shape[0]
    for v in range(top, bottom + 1):
        for u in range(left, right + 1):
            if mask[v, u] < INK_BELOW:
                w = side * (H_inv[2, 0] * (u + 0.5) + H_inv[2, 1] * (v + 0.5) + H_inv[2, 2])
                if w > 1e-12:
                    x = side * (H_inv[0, 0] * (u + 0.5) + H_inv[0, 1] * (v + 0.5) + H_inv[0, 2]) / w
                    y = side * (H_inv[1, 0] * (u + 0.5) + H_inv[1, 1] * (v + 0.5) + H_inv[1, 2]) / w
                    column = math.floor((x - x0) * per_m)
                    row = math.floor((y - y0) * per_m)
                    if 0 <= row < size and 0 <= column < size:
                        view[int(row), int(column)] = 0


@compiled(nogil=True)
def _look_up(mask, first_row, last_row, first_column, last_column, H, side, x0, y0, per_m, view):
    """Mark each cell whose centre the camera sees as ink."""
    height, width = mask.shape
    cell = 1.0 / per_m
    for row in range(first_row, last_row):
        y = y0 + (row + 0.5) * cell
        u_row = side * (H[0, 1] * y + H[0, 2])
        v_row = side * (H[1, 1] * y + H[1, 2])
        w_row = side * (H[2, 1] * y + H[2, 2])
        for column in range(first_column, last_column):
            x = x0 + (column + 0.5) * cell
            w = w_row + side * H[2, 0] * x
            u = u_row + side * H[0, 0] * x
            v = v_row + side * H[1, 0] * x
            if w > 0.0 and 0.0 <= u < width * w and 0.0 <= v < height * w:
                per_w = 1.0 / w
                # The product may round up to the width itself.
                i = min(int(v * per_w), height - 1)
                j = min(int(u * per_w), width - 1)
                if mask[i, j] < INK_BELOW:
                    view[row, column] = 0
