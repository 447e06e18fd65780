"""Where an arm's capsules and tip are: kinematics from the description alone, many postures at once, no MuJoCo."""

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import quat_to_matrix
from contactsafe.robot.description import ArmDescription, Tool

_ROUND = 24  # corners of a cylinder's outline


def link_frames(description: ArmDescription, q: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return the frames of base, links and tool mount in world axes, base at the origin.

    Args:
        description: the arm, of n joints.
        q: joint positions, (F, n), rad.

    Returns:
        Origins, (F, n + 2, 3), m, and rotations, (F, n + 2, 3, 3): base, links 1 to n, tool mount.

    Raises:
        InvalidInputError: q has another shape.
    """
    n = len(description.links)
    q = np.asarray(q, dtype=float)
    if q.ndim != 2 or q.shape[1] != n:
        raise InvalidInputError(f"q has shape {q.shape}; give F × {n} joint positions, one row a posture")
    origins = np.zeros((len(q), n + 2, 3))
    rotations = np.zeros((len(q), n + 2, 3, 3))
    rotations[:, 0] = np.eye(3)
    for i, link in enumerate(description.links, start=1):
        _attach(origins, rotations, i, link.position, link.quat)
        rotations[:, i] = rotations[:, i] @ _about_z(q[:, i - 1])
    _attach(origins, rotations, n + 1, description.mount_position, description.mount_quat)
    return origins, rotations


def arm_capsules(
    description: ArmDescription, tool: Tool, q: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Place all capsules of an arm and its tool in the world.

    Args:
        description: the arm, of n joints.
        tool: what the flange carries.
        q: joint positions, (F, n), rad.

    Returns:
        Centres of the round ends, starts and ends, (F, K, 3), m; radii, (K,), m; and what each belongs to, (K,):
        0 the base, 1 to n a link, n + 1 the tool.

    Raises:
        InvalidInputError: q has another shape.
    """
    origins, rotations = link_frames(description, q)
    groups = (description.base_capsules, *(link.capsules for link in description.links), tool.capsules)
    owned = [(owner, capsule) for owner, capsules in enumerate(groups) for capsule in capsules]
    links = np.array([owner for owner, _ in owned])
    radii = np.array([capsule.radius for _, capsule in owned])
    local = np.array([(capsule.start, capsule.end) for _, capsule in owned])  # (K, 2, 3)
    placed = np.einsum("fkij,kej->fkei", rotations[:, links], local) + origins[:, links, None]
    return placed[:, :, 0], placed[:, :, 1], radii, links


def tip_rings(tool: Tool) -> np.ndarray:
    """Return the corners of a tool's tip, about the face at its TCP and about the opposite one, in the mount's frame.

    Args:
        tool: with a tip.

    Returns:
        (2, K, 3), m, both in the order that is counter-clockwise for who faces the TCP: K is 4 for a box, 24 for a
        cylinder.

    Raises:
        InvalidInputError: the tool has no tip.
    """
    if tool.tip is None:
        raise InvalidInputError(f"tool '{tool.name}' has no tip; give one that has, such as robots.WIPER")
    corners = 4 if tool.tip.shape == "box" else _ROUND
    angles = 2.0 * np.pi * (np.arange(corners) + 0.5) / corners
    reach = np.sqrt(2.0) if corners == 4 else 1.0
    half = np.array(tool.tip.half_size)
    ring = reach * half * np.stack([np.cos(angles), np.sin(angles), np.zeros(corners)], axis=1)
    return np.array(tool.tcp) + np.stack([ring, ring - (0.0, 0.0, 2.0 * half[2])])


def tip_corners(description: ArmDescription, tool: Tool, q: ArrayLike) -> np.ndarray:
    """Place the corners of the tool's tip in the world.

    Args:
        description: the arm, of n joints.
        tool: what the flange carries, with a tip.
        q: joint positions, (F, n), rad.

    Returns:
        (F, 2, K, 3), m, in the order of `tip_rings`.

    Raises:
        InvalidInputError: the tool has no tip, or q has another shape.
    """
    rings = tip_rings(tool)
    origins, rotations = link_frames(description, q)
    return origins[:, -1, None, None] + rings @ rotations[:, -1, None].swapaxes(-1, -2)


def _attach(origins: np.ndarray, rotations: np.ndarray, index: int, position, quat) -> None:
    """Fill frame `index` as fixed to the one before it."""
    origins[:, index] = origins[:, index - 1] + rotations[:, index - 1] @ np.array(position)
    rotations[:, index] = rotations[:, index - 1] @ quat_to_matrix(np.array(quat))


def _about_z(angle: np.ndarray) -> np.ndarray:
    """Rotation matrices about z, (F, 3, 3), of angles (F,), rad."""
    turn = np.zeros((len(angle), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0] = np.sin(angle)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    return turn
