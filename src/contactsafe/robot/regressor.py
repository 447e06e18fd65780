"""What links do to an arm's momentum, linear in their inertial parameters: many rows of a log at once, no MuJoCo calls.

With p = M q̇ and β = g − Cᵀ q̇ the joint torque that drives the links is τ = ṗ + β, and both are linear in the ten
parameters of each body: m, m c (3), and the tensor about the frame's origin xx, yy, zz, xy, xz, yz. So is the impulse
between two rows, p₂ − p₁ + ∫β dt, which needs no acceleration.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from contactsafe.core.rotation import quat_to_matrix
from contactsafe.robot.arm import Arm
from contactsafe.robot.description import Inertia, point_tensor

PARAMETERS = 10
"""Of a body: m kg, m c kg m, tensor about the frame's origin kg m²."""


class Motion(NamedTuple):
    """How an arm moves in T rows: spatial vectors about the world's origin, angular part first.

    Attributes:
        axes: motion of each joint, (T, n, 6).
        rates: of them in time, (T, n, 6), 1/s.
        twists: velocity of each link, (T, n, 6).
        origins: of the links' frames, (T, n, 3), m.
        rotations: of the links' frames, (T, n, 3, 3).
    """

    axes: np.ndarray
    rates: np.ndarray
    twists: np.ndarray
    origins: np.ndarray
    rotations: np.ndarray


def motion_of(arm: Arm, q: np.ndarray, qd: np.ndarray) -> Motion:
    """Return where the links are and how they move.

    Args:
        arm: of n joints.
        q: joint positions, (T, n), rad.
        qd: joint velocities, (T, n), rad/s.
    """
    model, rows, n = arm.model, len(q), arm.n
    axes, rates, twists = (np.zeros((rows, n, 6)) for _ in range(3))
    origins, rotations = np.zeros((rows, n, 3)), np.zeros((rows, n, 3, 3))
    origin, R, twist = *_base(model), np.zeros((rows, 6))
    for i in range(n):
        body = int(model.jnt_bodyid[i])
        origin = origin + R @ model.body_pos[body]
        R = R @ quat_to_matrix(model.body_quat[body])
        z, anchor = R @ model.jnt_axis[i], origin + R @ model.jnt_pos[i]
        turned = R @ _turn(model.jnt_axis[i], q[:, i] - model.qpos0[i])
        origin, R = anchor - turned @ model.jnt_pos[i], turned
        axes[:, i, :3], axes[:, i, 3:] = z, np.cross(anchor, z)
        rates[:, i] = _cross_motion(twist, axes[:, i])
        twist = twist + axes[:, i] * qd[:, i, None]
        twists[:, i], origins[:, i], rotations[:, i] = twist, origin, R
    return Motion(axes, rates, twists, origins, rotations)


def link_regressor(arm: Arm, motion: Motion, link: int) -> tuple[np.ndarray, np.ndarray]:
    """Return momentum and β of each joint per inertial parameter of a body fixed to a link, in the link's frame.

    Args:
        arm: of n joints.
        motion: of T rows.
        link: 1 … n.

    Returns:
        Both (T, n, 10); zero for joints beyond the link.
    """
    k, n = link - 1, arm.n
    R, origin = motion.rotations[:, k], motion.origins[:, k]
    w, v = _local(R, origin, motion.twists[:, k])
    gravity = np.einsum("tji,j->ti", R, _gravity(arm))
    p, beta = np.zeros((len(R), n, PARAMETERS)), np.zeros((len(R), n, PARAMETERS))
    for i in range(link):
        p[:, i] = _momentum_row(*_local(R, origin, motion.axes[:, i]), w, v)
        beta[:, i] = -_momentum_row(*_local(R, origin, motion.rates[:, i]), w, v)
        turn, shift = _local(R, origin, motion.axes[:, i])
        beta[:, i, 0] -= np.einsum("ti,ti->t", shift, gravity)
        beta[:, i, 1:4] -= np.cross(gravity, turn)
    return p, beta


def nominal_terms(arm: Arm, motion: Motion, qd: np.ndarray, rotors: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return momentum, kg m²/s, and β = g − Cᵀ q̇, N m, of the arm's own model, both (T, n).

    Args:
        arm: of n joints.
        motion: of T rows.
        qd: joint velocities, (T, n), rad/s.
        rotors: whether the momentum of the rotors is part of it.
    """
    p, beta = np.zeros_like(qd), np.zeros_like(qd)
    for link in range(1, arm.n + 1):
        inertia = parameters_of(link_inertia(arm, link))
        per_p, per_beta = link_regressor(arm, motion, link)
        p += per_p @ inertia
        beta += per_beta @ inertia
    if rotors:
        p += arm.model.dof_armature * qd
    return p, beta


def link_inertia(arm: Arm, link: int) -> Inertia:
    """Return the inertia of a link with all that is fixed to it, in the frame of its body."""
    model, first = arm.model, int(arm.model.jnt_bodyid[link - 1])
    total = inertia_in_body(model, first)
    for body in range(first + 1, model.nbody):
        if model.body_weldid[body] != first or model.body_mass[body] == 0.0:
            continue
        R, origin = _in_body(model, body, first, np.eye(3), np.zeros(3))
        own = inertia_in_body(model, body)
        total = total + Inertia.of(own.mass, origin + R @ np.array(own.com), R @ own.matrix() @ R.T)
    return total


def inertia_in_body(model: mujoco.MjModel, body: int) -> Inertia:
    """Return the inertia of one body in its own frame."""
    turn = quat_to_matrix(model.body_iquat[body])
    matrix = turn @ np.diag(model.body_inertia[body]) @ turn.T
    return Inertia.of(float(model.body_mass[body]), model.body_ipos[body], matrix)


def parameters_of(inertia: Inertia) -> np.ndarray:
    """Return the ten parameters of a body, in which torque is linear, (10,)."""
    c = np.array(inertia.com)
    about_origin = Inertia.of(inertia.mass, c, inertia.matrix() + point_tensor(inertia.mass, c))
    return np.array([inertia.mass, *(inertia.mass * c), *about_origin.tensor])


def inertia_of(parameters: np.ndarray) -> Inertia:
    """Return the body that has ten parameters, whose mass is not zero; see `parameters_of`."""
    mass, moment, tensor = np.split(parameters, [1, 4])
    kg = float(mass[0])
    about_origin = Inertia(kg, (0.0, 0.0, 0.0), tuple(tensor.tolist()))
    return Inertia.of(kg, moment / kg, about_origin.matrix() - point_tensor(kg, moment / kg))


def site_in_link(arm: Arm) -> tuple[np.ndarray, np.ndarray]:
    """Return the tool's frame in that of the last link: rotation (3, 3), and origin (3,), m."""
    model, site = arm.model, arm.model.site(arm.site).id
    body = int(model.site_bodyid[site])
    link = int(model.body_weldid[body])
    return _in_body(model, body, link, quat_to_matrix(model.site_quat[site]), model.site_pos[site])


def _base(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Return the frame that the first link's body is placed in."""
    body = int(model.body_parentid[model.jnt_bodyid[0]])
    R, origin = _in_body(model, body, 0, np.eye(3), np.zeros(3))
    return origin, R


def _in_body(
    model: mujoco.MjModel, body: int, above: int, R: np.ndarray, origin: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return a frame that is fixed to a body in the frame of one above it, while all joints between are at rest."""
    while body != above:
        turn = quat_to_matrix(model.body_quat[body])
        R, origin = turn @ R, model.body_pos[body] + turn @ origin
        body = int(model.body_parentid[body])
    return R, np.array(origin)


def _gravity(arm: Arm) -> np.ndarray:
    return np.array(arm.model.opt.gravity)


def _turn(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return rotations about an axis (3,) by angles (T,), (T, 3, 3); Rodrigues."""
    K = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * K + (1.0 - c) * (K @ K)


def _cross_motion(twist: np.ndarray, axis: np.ndarray) -> np.ndarray:
    turn = np.cross(twist[:, :3], axis[:, :3])
    shift = np.cross(twist[:, :3], axis[:, 3:]) + np.cross(twist[:, 3:], axis[:, :3])
    return np.concatenate([turn, shift], axis=1)


def _local(R: np.ndarray, origin: np.ndarray, spatial: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return angular and linear part of a motion at a frame's origin, in its axes, (T, 3) each."""
    shift = spatial[:, 3:] + np.cross(spatial[:, :3], origin)
    return np.einsum("tji,tj->ti", R, spatial[:, :3]), np.einsum("tji,tj->ti", R, shift)


def _momentum_row(turn: np.ndarray, shift: np.ndarray, w: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return a motion (turn, shift) times the momentum of a body that moves with (w, v), per parameter, (T, 10)."""
    row = np.empty((len(w), PARAMETERS))
    row[:, 0] = np.einsum("ti,ti->t", shift, v)
    row[:, 1:4] = np.cross(shift, w) + np.cross(v, turn)
    row[:, 4:7] = turn * w
    for column, (a, b) in enumerate(((0, 1), (0, 2), (1, 2)), start=7):
        row[:, column] = turn[:, a] * w[:, b] + turn[:, b] * w[:, a]
    return row
