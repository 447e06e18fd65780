"""The surface of an arm: points where something may touch it, and the direction in which it can push there."""

import copy
import math

import mujoco
import numpy as np

from contactsafe.robot.bodies import shown_geoms
from contactsafe.robot.description import ArmDescription, Capsule
from contactsafe.robot.rays import cast

SURFACE_COLUMNS = 7
"""Link 1 … n, point x y z in the link's frame, m, outward normal x y z."""

_ALONG, _AROUND = 5, 12

POINTS = 480
"""Of an arm made of geoms, as many as the Panda of capsules has: searching them takes time in the tick."""

_STARTS, _DIRECTIONS = 1000, 5
"""Of the lines that look for a link's surface; few directions from a start, or the points would huddle before it."""

_TURN_M = 0.02
"""Points whose normals differ by 1 count as so far apart: a thin plate has two sides."""


def capsule_surface(description: ArmDescription) -> np.ndarray:
    """Sample the capsules of an arm's links, (P, 7) rows as in `SURFACE_COLUMNS`.

    Link 1 is left out: what touches it can only turn it about its own axis, and joint torques show next to nothing.
    """
    rows = [
        _capsule_points(index, capsule)
        for index, link in enumerate(description.links, start=1)
        if index > 1
        for capsule in link.capsules
    ]
    return np.concatenate([np.zeros((0, SURFACE_COLUMNS)), *rows])


def _capsule_points(link: int, capsule: Capsule) -> np.ndarray:
    start, end = np.array(capsule.start), np.array(capsule.end)
    axis = (end - start) / np.linalg.norm(end - start)
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    rows = []
    for fraction in np.linspace(0.0, 1.0, _ALONG):
        for turn in np.arange(_AROUND) * 2 * math.pi / _AROUND:
            normal = math.cos(turn) * side + math.sin(turn) * other
            rows.append([link, *(start + fraction * (end - start) + capsule.radius * normal), *normal])
    return np.array(rows)


def geom_surface(model: mujoco.MjModel, data: mujoco.MjData, link_of: np.ndarray, origins: np.ndarray) -> np.ndarray:
    """Sample the geoms of an arm's links in a scene, (P, 7) rows as in `SURFACE_COLUMNS`; P is at most 480.

    Of each link those geoms that can collide, or all of them where none can. A link without geoms has no points, and
    link 1 is left out as in `capsule_surface`.

    Args:
        model: of the scene.
        data: of it, with all bodies in place.
        link_of: link that each body is part of, 1 … n, 0 for what is none of the links', (nbody,).
        origins: of the links' frames, whose axes are the world's, (n, 3), m.
    """
    seen = copy.copy(model)
    seen.geom_matid[:], seen.geom_rgba[:, 3] = -1, 1.0  # rays pass through what is transparent
    found, rows = {}, [np.zeros((0, SURFACE_COLUMNS))]
    for link in range(2, len(origins) + 1):
        if len(points := _surface(seen, data, shown_geoms(model, link_of == link))):
            found[link] = points
    for link, points in found.items():
        points = spread(points, POINTS // len(found))
        points[:, :3] -= origins[link - 1]
        rows.append(np.insert(points, 0, link, axis=1))
    return np.concatenate(rows)


def _surface(model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray) -> np.ndarray:
    """Find where random lines first meet some geoms: points and outward normals in world axes, (H, 6).

    Lines between random points of a sphere come from everywhere alike: they meet all of a convex surface equally
    often per area (Crofton), and never first what lies within another geom. `model` loses its geoms' groups.
    """
    if not geoms.size:
        return np.zeros((0, 6))
    model.geom_group[:] = 1
    model.geom_group[geoms] = 0
    group = np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)
    centre = data.geom_xpos[geoms].mean(axis=0)
    radius = 1.01 * np.max(np.linalg.norm(data.geom_xpos[geoms] - centre, axis=1) + model.geom_rbound[geoms])
    rng = np.random.default_rng(0)
    starts, ends = (on_sphere(rng, (_STARTS, count)) * radius + centre for count in (1, _DIRECTIONS))
    directions = (ends - starts) / np.linalg.norm(ends - starts, axis=2, keepdims=True)
    found = [cast(model, data, start[0], direction, group) for start, direction in zip(starts, directions, strict=True)]
    distances, normals = np.array([one[0] for one in found]), np.array([one[1] for one in found])
    normals *= -np.sign(np.sum(normals * directions, axis=2, keepdims=True))  # whichever side a face has
    return np.concatenate([starts + distances[..., None] * directions, normals], axis=2)[distances >= 0.0]


def on_sphere(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """Sample points of the unit sphere, (*shape, 3)."""
    points = rng.normal(size=(*shape, 3))
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


def spread(points: np.ndarray, count: int) -> np.ndarray:
    """Choose points evenly, each the furthest from those chosen before it: at most `count` of (H, 6)."""
    place = points * np.repeat([1.0, _TURN_M], 3)
    chosen, gap = [0], np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        gap = np.minimum(gap, np.linalg.norm(place - place[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(gap)))
    return points[chosen]
