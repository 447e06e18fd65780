"""Rays against the geoms of a model: how far they go, and the normals of what they hit, whatever MuJoCo's version."""

import mujoco
import numpy as np

from contactsafe.core.native import MUJOCO

_TURN_RAD = 1e-4
"""By which rays are turned to find a normal: off by its square on what is curved."""


def cast(
    model: mujoco.MjModel, data: mujoco.MjData, start: np.ndarray, directions: np.ndarray, group: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Cast rays from one point.

    Before MuJoCo 4.0 `mj_multiRay` misses most of a mesh, and before 3.5 rays have no normals.

    Args:
        model: of what is hit.
        data: of it, with all geoms in place.
        start: (3,), m.
        directions: unit vectors, (k, 3).
        group: which groups of geoms count, (6,) uint8.

    Returns:
        Distances, (k,), m, −1 where nothing is hit, and unit normals of either sign, (k, 3).
    """
    k = len(directions)
    distance, normal, geom = np.zeros(k), np.zeros((k, 3)), np.zeros(k, dtype=np.int32)
    if MUJOCO >= (4, 0):
        flat = np.zeros(3 * k)
        mujoco.mj_multiRay(model, data, start, directions.ravel(), group, True, -1, geom, distance, flat, k, np.inf)
        return distance, flat.reshape(k, 3)
    for i, direction in enumerate(directions):
        if MUJOCO >= (3, 5):
            distance[i] = mujoco.mj_ray(model, data, start, direction, group, True, -1, geom[:1], normal[i])
        else:
            distance[i], normal[i] = _turned(model, data, start, direction, group)
    return distance, normal


def _turned(
    model: mujoco.MjModel, data: mujoco.MjData, start: np.ndarray, direction: np.ndarray, group: np.ndarray
) -> tuple[float, np.ndarray]:
    """Cast a ray, and two pairs of neighbours: the normal stands across what these hit."""
    geom = np.zeros(1, dtype=np.int32)
    side = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    side /= np.linalg.norm(side)
    edges = []
    for across in (side, np.cross(direction, side)):
        rays = [direction + sign * _TURN_RAD * across for sign in (1.0, -1.0)]
        reach = [mujoco.mj_ray(model, data, start, ray, group, True, -1, geom) for ray in rays]
        edges.append(reach[0] * rays[0] - reach[1] * rays[1] if min(reach) >= 0.0 else np.zeros(3))
    normal = np.cross(edges[0], edges[1])
    size = float(np.linalg.norm(normal))
    if size == 0.0:  # a neighbour misses: an edge
        return -1.0, normal
    return mujoco.mj_ray(model, data, start, direction, group, True, -1, geom), normal / size
