"""Where something may touch an arm or its tool: points spread evenly over the surface of both."""

import itertools
import math

import numpy as np

from contactsafe.robot.description import ArmDescription, Capsule, Tool
from contactsafe.robot.surface import POINTS, SURFACE_COLUMNS, on_sphere, spread

MAX_PLACES = 704
"""Of an arm and its tool, that the controller's records have room for."""

_TOOL_POINTS = 60
"""Of a tool's capsules; its tip has corners and edges beside them."""

_DENSE_M2 = 1e4
"""Points sampled on a square metre, from which those are chosen."""

_WITHIN = 1e-6  # m


def touchable(links: np.ndarray, tool: Tool | None) -> np.ndarray:
    """Return points of an arm's links and, behind them, of its tool, (P, 7) rows as in `SURFACE_COLUMNS`.

    Rows of the tool have link 0; they lie in the frame of the end-effector point, which comes first.

    Args:
        links: rows of the links, (P, 7).
        tool: None for the end-effector point alone.
    """
    return np.concatenate([links, _of_tool(tool)])


def capsule_places(description: ArmDescription, count: int = POINTS) -> np.ndarray:
    """Spread some 480 points over the capsules of an arm's links, as many per area everywhere, (P, 7).

    Link 1 is left out as in `capsule_surface`. On a Panda the points are 3 cm apart.

    Args:
        description: the arm.
        count: how many points, at most `_DENSE_M2` on a square metre.
    """
    rng = np.random.default_rng(0)
    dense = {
        index: _on_capsules(rng, link.capsules)
        for index, link in enumerate(description.links, start=1)
        if index > 1 and link.capsules
    }
    total = sum(len(points) for points in dense.values())
    rows = [
        np.insert(spread(points, round(count * len(points) / total)), 0, link, axis=1) for link, points in dense.items()
    ]
    return np.concatenate([np.zeros((0, SURFACE_COLUMNS)), *rows])


def _of_tool(tool: Tool | None) -> np.ndarray:
    """Return the tool's points; their normals say nothing, an edge or a corner is pushed from anywhere."""
    rows = [np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])]
    if tool is not None and tool.capsules:
        points = spread(_on_capsules(np.random.default_rng(0), tool.capsules), _TOOL_POINTS)
        points[:, :3] -= tool.tcp
        rows.append(np.insert(points, 0, 0, axis=1))
    if tool is not None and tool.tip is not None:
        half = np.array(tool.tip.half_size)
        corners = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3))) * half
        points = np.zeros((len(corners), SURFACE_COLUMNS))
        points[:, 1:4], points[:, 6] = corners - [0.0, 0.0, half[2]], 1.0
        rows.append(points)
    return np.concatenate(rows)


def _on_capsules(rng: np.random.Generator, capsules: tuple[Capsule, ...]) -> np.ndarray:
    """Sample the surface of a union of capsules, as many points per area everywhere: points and normals, (M, 6)."""
    found = []
    for capsule in capsules:
        points = _on_capsule(rng, capsule)
        hidden = np.zeros(len(points), dtype=bool)
        for other in capsules:
            if other is not capsule:
                hidden |= _distance_to_axis(points[:, :3], other) < other.radius - _WITHIN
        found.append(points[~hidden])
    return np.concatenate(found)


def _on_capsule(rng: np.random.Generator, capsule: Capsule) -> np.ndarray:
    start, axis, length, radius = *_axis(capsule), capsule.radius
    # The area of a band of a sphere depends on its height alone, as that of a cylinder does (Archimedes).
    along = rng.uniform(-radius, length + radius, round(_DENSE_M2 * 2.0 * math.pi * radius * (length + 2.0 * radius)))
    beyond = along - np.clip(along, 0.0, length)
    around = np.cross(on_sphere(rng, along.shape), axis)
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    normals = np.sqrt(np.maximum(1.0 - (beyond / radius) ** 2, 0.0))[:, None] * around + np.outer(beyond / radius, axis)
    return np.hstack([start + np.outer(along - beyond, axis) + radius * normals, normals])


def _distance_to_axis(points: np.ndarray, capsule: Capsule) -> np.ndarray:
    start, axis, length = _axis(capsule)
    along = np.clip((points - start) @ axis, 0.0, length)
    return np.linalg.norm(points - start - np.outer(along, axis), axis=1)


def _axis(capsule: Capsule) -> tuple[np.ndarray, np.ndarray, float]:
    """Return where a capsule's axis starts, its direction, any for a sphere, and its length."""
    start, end = np.array(capsule.start), np.array(capsule.end)
    length = float(np.linalg.norm(end - start))
    return start, (end - start) / length if length > 0.0 else np.array([0.0, 0.0, 1.0]), length
