"""The camera's mask, fine about the tool and coarse far off, with no speck too small to count.

What a wiping policy must read off the picture is where ink is from here. A grid in the camera's frame, or a small
code of one, loses the last speck; a grid in the logarithm of the distance keeps it, and says direction and distance
outright. Nothing here is learned.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.byte_scan import places_unlike
from contactsafe.core.compiled import compiled
from contactsafe.core.copying import Threads
from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.checks import checked_homography, checked_tools
from contactsafe.vision.rectify import INK_BELOW

RINGS = 10
SECTORS = 16
RADIUS_M = (0.01, 0.45)
"""Distances of the first and the last ring's middle; nearer counts as the first, farther as the last."""

SCALES_M = (0.01, 0.03, 0.1)
"""Ink this far from the nearest ink counts 1/e in the patch about it."""

AMOUNT_M2 = 2e-5
"""Ink area that counts as one, about a camera pixel: amounts are given as log(1 + area / AMOUNT_M2)."""

NEAR_M = 0.02
"""Distance below which the direction to ink fades."""

FEATURES = RINGS * SECTORS + 4 * len(SCALES_M) + 1
"""Numbers in the log-polar features."""

CHUNKS = 2
"""Into which a batch is split for threads."""


class Ground(NamedTuple):
    """Where each camera pixel looks at on the board.

    Attributes:
        place: x, y of its middle, m, (pixels, 2).
        area: that it covers, m²; 0 where it looks past the board's plane, (pixels,).
    """

    place: np.ndarray
    area: np.ndarray


def ground_of(homography: ArrayLike | None, size: Sequence[int]) -> Ground:
    """Find where the pixels of a camera look at.

    Args:
        homography: board plane (x, y, 1) in m to homogeneous pixels (u = column, v = row, w), (3, 3). Pixel centres lie
            at integer + 0.5.
        size: rows and columns of its mask.

    Returns:
        `Ground`.

    Raises:
        InvalidInputError: the homography is not finite (3, 3), or cannot be inverted.
    """
    inverse = np.linalg.inv(checked_homography(homography))
    v, u = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5, indexing="ij")
    x, y, w = np.einsum("ij,jkl->ikl", inverse, np.stack([u, v, np.ones_like(u)]))
    side = np.sign(w[size[0] // 2, size[1] // 2])
    visible = side * w > 1e-9
    w = np.where(visible, w, 1.0)
    # The area that a homography maps to one pixel: |det H⁻¹| / |w|³.
    area = np.where(visible, abs(np.linalg.det(inverse)) / np.abs(w) ** 3, 0.0)
    place = np.stack([x / w, y / w], axis=-1)
    return Ground(place.reshape(-1, 2), np.ascontiguousarray(area.reshape(-1)))


def log_polar_features(
    masks: ArrayLike, tool_positions: ArrayLike, ground: Ground, threads: Threads | None = None
) -> np.ndarray:
    """Compute where ink is as seen from each tool.

    Features, in this order: log-amount of ink in each of RINGS × SECTORS cells about the tool, rings evenly spaced in
    the logarithm of distance, sectors from world x towards y, each pixel spread over the cells about it; for each
    of SCALES_M the middle of the patch about the nearest ink: direction (2), fading below NEAR_M, its distance / 0.1 m,
    and the log-amount of ink that goes into it; log-amount of all ink in view. All are 0 where no ink is in view.

    A patch is about one place, so that of two patches as far away on either side the finer scales say the one or the
    other. Their mean would lie under the tool, and a policy that believed it would stay there.

    Args:
        masks: camera masks, (N, height, width) or (N, height, width, 1), uint8: 0 is ink, 255 all else.
        tool_positions: tool points in world, (N, 2) or wider, m; only x and y are read.
        ground: `Ground` of the camera.
        threads: `Threads` that divide the work; None to do it here.

    Returns:
        (N, FEATURES) float32.

    Raises:
        InvalidInputError: a shape or type differs from the above.
    """
    masks = np.asarray(masks)
    if masks.dtype != np.uint8 or masks.ndim < 3 or masks[0].size != len(ground.area):
        raise InvalidInputError(
            f"masks are {masks.dtype} of shape {masks.shape}; give uint8 of {len(ground.area)} pixels each"
        )
    tool_xy = checked_tools(tool_positions, len(masks))
    features = np.zeros((len(masks), FEATURES), dtype=np.float32)
    flat = np.ascontiguousarray(masks).reshape(len(masks), -1)
    arrays = (flat, tool_xy, ground.place, ground.area, features)
    if threads is None:
        _fill_features(0, len(masks), *arrays)
    else:
        _fill_in_threads(threads, len(masks), arrays)
    return features


def _fill_in_threads(threads: Threads, count: int, arrays: tuple[np.ndarray, ...]) -> None:
    bounds = np.linspace(0, count, min(count, CHUNKS) + 1).astype(int).tolist()
    for chunk in [threads.submit(_fill_features, start, stop, *arrays) for start, stop in itertools.pairwise(bounds)]:
        chunk.result()


@compiled(nogil=True)
def _fill_features(start, stop, masks, tool_xy, place, area, features):
    for n in range(start, stop):
        if math.isfinite(tool_xy[n, 0]) and math.isfinite(tool_xy[n, 1]):
            _fill_features_of(masks[n], tool_xy[n, 0], tool_xy[n, 1], place, area, features[n])


@compiled(nogil=True)
def _fill_features_of(mask, tool_x, tool_y, place, area, out):
    pixels = np.empty(mask.shape[0], dtype=np.int32)
    count, near = _list_ink(mask, tool_x, tool_y, place, area, pixels)
    if count == 0:
        return
    grid, patches, total = np.zeros((RINGS, SECTORS)), np.zeros((len(SCALES_M), 3)), 0.0
    for p in pixels[:count]:
        dx, dy = place[p, 0] - tool_x, place[p, 1] - tool_y
        distance = math.sqrt(dx * dx + dy * dy)
        total += area[p]
        _spread(dx, dy, distance, area[p], grid)
        away = math.sqrt((place[p, 0] - place[near, 0]) ** 2 + (place[p, 1] - place[near, 1]) ** 2)
        for k in range(len(SCALES_M)):
            weight = area[p] * math.exp(-away / SCALES_M[k])
            patches[k, 0] += weight * dx
            patches[k, 1] += weight * dy
            patches[k, 2] += weight
    _write(grid, patches, total, out)


@compiled(nogil=True)
def _list_ink(mask, tool_x, tool_y, place, area, pixels):
    """List the pixels that are ink on the board; return how many, and the one nearest to the tool."""
    count, near, nearest = 0, 0, math.inf
    for p in pixels[: places_unlike(mask, np.uint8(255), pixels)]:
        if mask[p] < INK_BELOW and area[p] > 0.0:
            pixels[count] = p
            count += 1
            distance = (place[p, 0] - tool_x) ** 2 + (place[p, 1] - tool_y) ** 2
            if distance < nearest:
                near, nearest = p, distance
    return count, near


@compiled(nogil=True)
def _spread(dx, dy, distance, amount, grid):
    """Spread an amount over the two rings and the two sectors about its place."""
    ring = math.log(max(distance, 1e-6) / RADIUS_M[0]) / math.log(RADIUS_M[1] / RADIUS_M[0]) * (RINGS - 1)
    ring = min(max(ring, 0.0), RINGS - 1.0)
    sector = (math.atan2(dy, dx) / (2.0 * math.pi) % 1.0) * SECTORS
    r, s = int(ring), int(sector)
    up, on = ring - r, sector - s
    r_up = min(r + 1, RINGS - 1)
    s, s_on = s % SECTORS, (s + 1) % SECTORS
    grid[r, s] += amount * (1.0 - up) * (1.0 - on)
    grid[r, s_on] += amount * (1.0 - up) * on
    grid[r_up, s] += amount * up * (1.0 - on)
    grid[r_up, s_on] += amount * up * on


@compiled(nogil=True)
def _write(grid, patches, total, out):
    k = 0
    for r in range(RINGS):
        for s in range(SECTORS):
            out[k] = math.log1p(grid[r, s] / AMOUNT_M2)
            k += 1
    for scale in range(patches.shape[0]):
        x, y = patches[scale, 0] / patches[scale, 2], patches[scale, 1] / patches[scale, 2]
        distance = math.sqrt(x * x + y * y)
        out[k], out[k + 1] = x / (distance + NEAR_M), y / (distance + NEAR_M)
        out[k + 2] = distance / 0.1
        out[k + 3] = math.log1p(patches[scale, 2] / AMOUNT_M2)
        k += 4
    out[k] = math.log1p(total / AMOUNT_M2)
