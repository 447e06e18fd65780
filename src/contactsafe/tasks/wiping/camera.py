"""What the camera sees: the segmented mask of the board, ink 0 and everything else 255, by homography.

The board is a plane, so a pixel of the mask is a place on the board: each inked cell marks the pixels its corners fall
in. The arm stands before the board: a marked pixel whose ray meets one of the arm's shapes is unmarked.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.native import view2
from contactsafe.robot.mjcf import ARM_CONTYPE
from contactsafe.tasks.wiping.board import Camera
from contactsafe.tasks.wiping.ink import count_shown, list_cells
from contactsafe.tasks.wiping.whiteboard import Whiteboard

INK_PIXEL, OTHER_PIXEL = 0, 255

_MOST_CELLS, _MOST_ROWS = 2**16 - 1, 2**15 - 1  # what the counts and numbers of an `InkIndex` hold


def camera_axes(camera: Camera) -> np.ndarray:
    """Return the camera's axes in the world, columns right, down, forward, (3, 3); it stands upright."""
    forward = np.array(camera.target) - np.array(camera.position)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(forward, right), forward])


def plane_homography(camera: Camera, z: float) -> np.ndarray:
    """Compute H with (u, v, 1) ~ H (x, y, 1) for points of the world plane at height z.

    Args:
        camera: the camera.
        z: m.

    Returns:
        (3, 3); u is the column, v the row; the middle of pixel (0, 0) is (0.5, 0.5).
    """
    R = camera_axes(camera).T
    t = -R @ np.array(camera.position)
    K = np.array([[camera.focal_px, 0.0, camera.size / 2], [0.0, camera.focal_px, camera.size / 2], [0.0, 0.0, 1.0]])
    return K @ np.column_stack([R[:, 0], R[:, 1], R[:, 2] * z + t])


class CameraTables(NamedTuple):
    """What rendering a mask needs to know of camera and board, computed once for both.

    Attributes:
        pixels: row and column of the pixels that the corners of each cell fall in, each pixel once, then −1, int16
            (rows, columns, 4, 2).
        rays: unit ray of each pixel, world, (size, size, 3).
        distance: along it to the board's plane, m, (size, size).
        position: of the camera, (3,), m.
        axes: right, down, forward as columns, (3, 3).
        focal_px: (1,).
        shapes: number of each of the arm's geoms and 1 where it is a box, (k, 2).
        sizes: of all geoms, (ngeom, 3), m.
    """

    pixels: np.ndarray
    rays: np.ndarray
    distance: np.ndarray
    position: np.ndarray
    axes: np.ndarray
    focal_px: np.ndarray
    shapes: np.ndarray
    sizes: np.ndarray


def camera_tables(camera: Camera, board: Whiteboard, model: mujoco.MjModel) -> CameraTables:
    """Prepare to render masks of a board before an arm.

    Args:
        camera: the camera.
        board: for the places of its cells.
        model: plant model; its geoms with contype 2 are the arm's.
    """
    z = board.config.centre[2]
    axes = camera_axes(camera)
    rays = _pixel_rays(camera, axes)
    position = np.array(camera.position)
    arm = [i for i in range(model.ngeom) if model.geom_contype[i] == ARM_CONTYPE]
    return CameraTables(
        pixels=_corner_pixels(board, plane_homography(camera, z), camera.size),
        rays=rays,
        distance=_distance_to_plane(rays, position, z),
        position=position,
        axes=axes,
        focal_px=np.array([camera.focal_px]),
        shapes=np.array([[i, int(model.geom_type[i] == mujoco.mjtGeom.mjGEOM_BOX)] for i in arm], dtype=np.int64),
        sizes=model.geom_size.copy(),
    )


def stack_cameras(tables: Sequence[CameraTables]) -> CameraTables:
    """Put the tables of several cameras of one world side by side, along a new first axis of all but its shapes."""
    own = [name for name in CameraTables._fields if name not in ("shapes", "sizes")]
    return tables[0]._replace(**{name: np.stack([getattr(table, name) for table in tables]) for name in own})


@compiled
def camera_at(cameras: CameraTables, index: int) -> CameraTables:
    """Return one camera's tables out of those that `stack_cameras` put side by side."""
    return CameraTables(
        cameras.pixels[index], cameras.rays[index], cameras.distance[index], cameras.position[index],
        cameras.axes[index], cameras.focal_px[index], cameras.shapes, cameras.sizes,
    )  # fmt: skip


def _corner_pixels(board: Whiteboard, H: np.ndarray, size: int) -> np.ndarray:
    """Row and column of the pixels that each cell's corners fall in, each once, then −1, (rows, columns, 4, 2)."""
    cell = board.config.cell
    inset = 0.02  # of a cell: a corner belongs to its own cell
    i, j = np.meshgrid(np.arange(board.cells.shape[0]), np.arange(board.cells.shape[1]), indexing="ij")
    pixels = np.empty((*board.cells.shape, 4), dtype=np.int64)
    for k, (di, dj) in enumerate(((inset, inset), (inset, 1 - inset), (1 - inset, inset), (1 - inset, 1 - inset))):
        x = board.origin[0] + (i + di) * cell
        y = board.origin[1] + (j + dj) * cell
        u, v, w = (H[r, 0] * x + H[r, 1] * y + H[r, 2] for r in range(3))
        column, row = np.floor(u / w).astype(int), np.floor(v / w).astype(int)
        inside = (column >= 0) & (column < size) & (row >= 0) & (row < size) & (w > 0)
        pixel = np.where(inside, row * size + column, -1)
        known = (pixels[..., :k] == pixel[..., None]).any(axis=-1)
        pixels[..., k] = np.where(known, -1, pixel)
    pixels = -np.sort(-pixels, axis=-1)
    most = np.bincount(pixels[pixels >= 0], minlength=1).max()
    if most > _MOST_CELLS or max(board.cells.shape) > _MOST_ROWS:
        raise InvalidInputError(
            f"one pixel of the camera shows {most} cells of a board of {board.cells.shape}; at most {_MOST_CELLS} and "
            f"{_MOST_ROWS} rows can be counted: make the board's cell larger"
        )
    return np.where(pixels[..., None] < 0, -1, np.stack([pixels // size, pixels % size], axis=-1)).astype(np.int16)


def _pixel_rays(camera: Camera, axes: np.ndarray) -> np.ndarray:
    """Unit ray through the middle of each pixel, world, (size, size, 3)."""
    middle = (np.arange(camera.size) + 0.5 - camera.size / 2) / camera.focal_px
    u, v = np.meshgrid(middle, middle)
    rays = u[..., None] * axes[:, 0] + v[..., None] * axes[:, 1] + axes[:, 2]
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def _distance_to_plane(rays: np.ndarray, position: np.ndarray, z: float) -> np.ndarray:
    """How far along each ray the board's plane lies, m; inf where it is not met, (size, size)."""
    with np.errstate(divide="ignore"):
        distance = (z - position[2]) / rays[..., 2]
    return np.where(distance > 0, distance, np.inf)


@compiled(nogil=True)
def render_mask(camera: CameraTables, cells: np.ndarray, plant: Record, out: np.ndarray) -> None:
    """Render a mask of a board as it is: ink and dark objects 0, everything else 255.

    Args:
        camera: `CameraTables`.
        cells: the board's, uint8, (rows, columns).
        plant: `mujoco_dtype` record, for where the arm's shapes are.
        out: uint8, (size, size); overwritten.
    """
    listed = np.empty((cells.size, 2), dtype=np.int16)
    shown = np.empty(out.shape, dtype=np.uint16)
    count_shown(camera.pixels, listed[: list_cells(cells, listed)], shown)
    render_mask_into(camera, shown, plant, out)


@compiled(nogil=True)
def render_mask_into(camera: CameraTables, shown: np.ndarray, plant: Record, out: np.ndarray) -> None:
    """Render a mask from what an `InkIndex` keeps.

    Args:
        camera: `CameraTables`.
        shown: in how many cells that are not clean each pixel has a part, uint16 (size, size).
        plant: `mujoco_dtype` record, for where the arm's shapes are.
        out: uint8, (size, size); overwritten.
    """
    out[:] = OTHER_PIXEL
    marked = _mark(shown, out)
    xpos, xmat = view2(plant.geom_xpos, plant.ngeom, 3), view2(plant.geom_xmat, plant.ngeom, 9)
    for s in range(camera.shapes.shape[0]):
        geom = camera.shapes[s, 0]
        _hide_behind(camera, camera.shapes[s, 1], camera.sizes[geom], xpos[geom], xmat[geom], marked, out)


@compiled
def _mark(shown, out):
    """Mark the pixels that show anything; return their rows and columns, (count, 2)."""
    size = out.shape[1]
    counts, flat = shown.reshape(-1), out.reshape(-1)
    marked = np.empty((flat.shape[0], 2), dtype=np.int16)
    count = 0
    fours = counts[: counts.shape[0] // 4 * 4].view(np.uint64)
    for four in range(fours.shape[0] + 1):
        if four < fours.shape[0] and fours[four] == 0:
            continue
        for p in range(4 * four, min(4 * four + 4, flat.shape[0])):
            if counts[p] > 0:
                flat[p] = INK_PIXEL
                marked[count, 0], marked[count, 1] = p // size, p % size
                count += 1
    return marked[:count]


@compiled
def _hide_behind(camera, is_box, size, centre, mat, marked, out):
    """Unmark the marked pixels whose ray meets one shape before the board."""
    viewpoint, focal = camera.position, camera.focal_px[0]
    bound = math.sqrt(size[0] ** 2 + size[1] ** 2 + size[2] ** 2) if is_box else size[0] + size[1]
    x = np.zeros(3)
    for k in range(3):
        for m in range(3):
            x[k] += camera.axes[m, k] * (centre[m] - viewpoint[m])
    n = out.shape[0]
    depth = x[2] - bound
    if depth <= 1e-3:
        u0, u1, v0, v1 = 0, n, 0, n
    else:
        reach = focal * bound / depth + 1.0
        u, v = n / 2 + focal * x[0] / x[2], n / 2 + focal * x[1] / x[2]
        # A sphere seen from the side looks longer: its half width is at most bound/(depth) times (1 + |offset|/depth).
        stretch_u, stretch_v = 1.0 + abs(x[0]) / x[2], 1.0 + abs(x[1]) / x[2]
        u0, u1 = max(0, int(u - reach * stretch_u)), min(n, int(u + reach * stretch_u) + 2)
        v0, v1 = max(0, int(v - reach * stretch_v)), min(n, int(v + reach * stretch_v) + 2)
    rays = camera.rays
    for m in range(marked.shape[0]):
        row, column = marked[m, 0], marked[m, 1]
        if v0 <= row < v1 and u0 <= column < u1 and out[row, column] == INK_PIXEL:
            # A tuple: a slice of an array would be counted in and out of use, which costs more than the test.
            ray = (rays[row, column, 0], rays[row, column, 1], rays[row, column, 2])
            length = camera.distance[row, column]
            if is_box:
                hit = _ray_meets_box(viewpoint, ray, length, centre, mat, size)
            else:
                hit = _ray_meets_capsule(viewpoint, ray, length, centre, mat, size)
            if hit:
                out[row, column] = OTHER_PIXEL


@compiled
def _ray_meets_capsule(viewpoint, ray, length, centre, mat, size):
    """Whether a ray passes within a capsule's radius of its axis: closest points of two segments."""
    radius, half = size[0], size[1]
    ax, ay, az = mat[2], mat[5], mat[8]
    wx, wy, wz = viewpoint[0] - centre[0], viewpoint[1] - centre[1], viewpoint[2] - centre[2]
    b = ray[0] * ax + ray[1] * ay + ray[2] * az
    d = ray[0] * wx + ray[1] * wy + ray[2] * wz
    e = ax * wx + ay * wy + az * wz
    denominator = 1.0 - b * b
    s = (b * e - d) / denominator if denominator > 1e-9 else -d
    s = min(max(s, 0.0), length)
    t = min(max(b * s + e, -half), half)
    s = min(max(b * t - d, 0.0), length)
    px, py, pz = wx + s * ray[0] - t * ax, wy + s * ray[1] - t * ay, wz + s * ray[2] - t * az
    return px * px + py * py + pz * pz < radius * radius


@compiled
def _ray_meets_box(viewpoint, ray, length, centre, mat, size):
    """Whether a ray enters a box: the slab test in the box's axes."""
    near, far = 0.0, length
    for k in range(3):
        origin = 0.0
        direction = 0.0
        for m in range(3):
            origin += mat[3 * m + k] * (viewpoint[m] - centre[m])
            direction += mat[3 * m + k] * ray[m]
        if abs(direction) < 1e-12:
            if abs(origin) > size[k]:
                return False
            continue
        a, b = (-size[k] - origin) / direction, (size[k] - origin) / direction
        near, far = max(near, min(a, b)), min(far, max(a, b))
    return near < far
