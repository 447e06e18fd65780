"""Capsules that enclose the geoms of a scene: the shape of an arm that was not described by capsules."""

from typing import NamedTuple

import mujoco
import numpy as np

from contactsafe.robot.description import Capsule

_GEOM = mujoco.mjtGeom
_CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_TURN = 2 * np.pi * np.arange(64) / 64
_RADII = 64  # tried between the least that can enclose and the sphere's
_SHORT = 1e-6  # m; half the least length of a capsule, for MuJoCo takes no shorter one


class Hull(NamedTuple):
    """A convex shape: the hull of some points, grown by a radius.

    Attributes:
        points: (P, 3), m.
        radius: m.
        axes: directions that the axis of a capsule about it may take, (k, 3).
    """

    points: np.ndarray
    radius: float
    axes: np.ndarray


def geom_hull(model: mujoco.MjModel, geom: int) -> Hull:
    """Return a geom's shape in its own frame; an ellipsoid's is the capsule about it.

    A capsule of radius b, the middle half axis, about the segment of half length a − b on the longest, a, holds the
    ellipsoid: (x − a + b)² + b² (1 − x²/a²) ≤ b² wherever a − b ≤ x ≤ a.
    """
    kind, size, z = model.geom_type[geom], model.geom_size[geom], np.array([[0.0, 0.0, 1.0]])
    if kind == _GEOM.mjGEOM_SPHERE:
        return Hull(np.zeros((1, 3)), float(size[0]), z)
    if kind == _GEOM.mjGEOM_CAPSULE:
        return Hull(np.array([[-size[1]], [size[1]]]) * z, float(size[0]), z)
    if kind == _GEOM.mjGEOM_ELLIPSOID:
        middle, longest = np.sort(size)[1], int(np.argmax(size))
        axis = np.eye(3)[longest : longest + 1]
        return Hull((size[longest] - middle) * np.array([[-1.0], [1.0]]) * axis, float(middle), axis)
    if kind == _GEOM.mjGEOM_CYLINDER:
        rim = size[0] * np.column_stack([np.cos(_TURN), np.sin(_TURN), 0.0 * _TURN])
        return Hull(np.concatenate([rim - size[1] * z, rim + size[1] * z]), 0.0, z)
    if kind == _GEOM.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        return Hull(np.array(vertices, dtype=float), 0.0, np.eye(3))
    centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    return Hull(centre + _CORNERS * half, 0.0, np.eye(3))


def placed(hull: Hull, position: np.ndarray, rotation: np.ndarray) -> Hull:
    """Return a shape with its frame at a position (3,), m, and a rotation (3, 3)."""
    return Hull(position + hull.points @ rotation.T, hull.radius, hull.axes @ rotation.T)


def enclosing_capsule(hull: Hull) -> Capsule:
    """Return the capsule of least volume about a shape, of those along its axes through the middle of its extent."""
    return min((_along(hull, axis) for axis in hull.axes), key=lambda found: found[0])[1]


def _along(hull: Hull, axis: np.ndarray) -> tuple[float, Capsule]:
    """Return volume, m³, and capsule along one axis.

    A point at t along the axis and d beside it is within the round end at t₁ of radius r where t ≤ t₁ + √(r² − d²), so
    the wider a capsule the shorter it may be.
    """
    frame = with_axis(axis)
    along = hull.points @ frame
    middle = (along.min(axis=0) + along.max(axis=0)) / 2
    beside = np.hypot(along[:, 0] - middle[0], along[:, 1] - middle[1])
    t = along[:, 2] - middle[2]
    least, most = beside.max(), np.hypot(beside, t).max()
    r = (least + (most - least) * np.linspace(0.0, 1.0, _RADII) ** 2)[:, None]
    reach = np.sqrt(np.maximum(r * r - beside**2, 0.0))
    first, last = (t + reach).min(axis=1), (t - reach).max(axis=1)
    crossed = first > last  # one sphere serves, anywhere between
    first, last = np.where(crossed, (first + last) / 2, first), np.where(crossed, (first + last) / 2, last)
    radius = r[:, 0] + hull.radius
    volume = np.pi * radius**2 * (last - first + 4 / 3 * radius)
    k = int(np.argmin(volume))
    centre = frame @ middle
    return float(volume[k]), capsule_between(centre + first[k] * axis, centre + last[k] * axis, float(radius[k]))


def capsule_between(start: np.ndarray, end: np.ndarray, radius: float) -> Capsule:
    """Return a capsule between two points (3,), m, made as long as MuJoCo needs it."""
    if np.linalg.norm(end - start) < 2 * _SHORT:
        along_z = np.array([0.0, 0.0, _SHORT])
        start, end = start - along_z, end + along_z
    return Capsule(tuple(start.tolist()), tuple(end.tolist()), radius)


def with_axis(axis: np.ndarray) -> np.ndarray:
    """Return a rotation whose third column is a unit axis, (3, 3)."""
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    return np.column_stack([side, np.cross(axis, side), axis])
