"""Reaction: the contact-aware law (18), (21), (22), and what keeps the commanded contact force within its bound.

Mode FREE leaves the impedance alone; COMPLY recedes from an obstacle; REJECT resists a push. The bound lowers
the compensation first, then the task as a whole, last the damping.
"""

import math

import numpy as np

from contactsafe.control.codes import (
    COMPLY,
    FREE,
    LIMITED_BY_CONTACT,
    LIMITED_BY_TOOL_FORCE,
    OBSTACLE,
    PUSH,
    REJECT,
)
from contactsafe.control.damping import braking_limit
from contactsafe.control.laws import torque_against_contact
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot, matvec_t_into
from contactsafe.core.stack import stack_vector

_f = np.float64
_i = np.int64

WHOLE = 0.99
"""A task scale this large leaves nothing out that anyone would notice."""

reaction_dtype = np.dtype(
    [
        ("task_scale", _f),  # of the elastic part of the command in force, 0 … 1
        ("scale_reason", _i),  # key of LIMITS that lowered it
        ("posture_scale", _f),  # of K_posture in force
        ("initial_limit_n", _f),  # bound with which the contact began, falling, N
        ("reject_limit_nm", _f),  # bound in mode REJECT, falling, N m
        ("reject_decay_s", _f),  # time constant with which it falls, s
    ]
)
"""What the reaction remembers."""


@compiled
def begin_reaction(reaction: Record) -> None:
    """Meet a contact, or end one, with no bound of an earlier one."""
    reaction.reject_decay_s, reaction.reject_limit_nm, reaction.initial_limit_n = 0.0, 0.0, math.inf


@inlined
def react(reaction: Record, mode: int, shown: int, torque_nm: float, dt: float, params: Record) -> int:
    """Return the mode that what a contact has shown asks for, and let the bounds in force fall.

    Args:
        reaction: `reaction_dtype` record; its bounds are updated.
        mode: so far, COMPLY or REJECT.
        shown: what `classify` returned.
        torque_nm: of the contact along its direction, N m.
        dt: that passed, s.
        params: of reaction.
    """
    reaction.initial_limit_n = min(reaction.initial_limit_n, params.contact_force_limit_initial_n) * (
        1.0 - dt / params.contact_force_limit_decay_s
    )
    if shown == PUSH:
        fallen = 0.5 * (1.0 + params.reject_margin) * torque_nm
        if mode == COMPLY or reaction.reject_limit_nm < fallen:  # it receded because the bound had fallen
            reaction.reject_decay_s = max(2.0 * reaction.reject_decay_s, params.reject_decay_s)
        mode, reaction.reject_limit_nm = REJECT, params.reject_margin * torque_nm
    elif shown == OBSTACLE:
        mode, reaction.reject_decay_s, reaction.reject_limit_nm, reaction.initial_limit_n = COMPLY, 0.0, 0.0, 0.0
    if mode == REJECT:
        reaction.reject_limit_nm *= 1.0 - dt / reaction.reject_decay_s
    return mode


@inlined
def contact_limit(reaction: Record, isolation: Record, params: Record) -> float:
    """Return the bound in force, N m: a torque, and what a force comes to with the lever arm that isolation found."""
    comply = min(params.contact_torque_limit_comply_nm, params.contact_force_limit_comply_n * isolation.lever)
    reject = max(
        reaction.initial_limit_n * isolation.lever_max,
        min(reaction.reject_limit_nm, params.contact_force_limit_reject_n * isolation.lever_max),
    )
    return max(comply, min(reject, params.contact_torque_limit_reject_nm))


@inlined
def follow_task_scale(reaction: Record, mode: int, wanted: float, reason: int, step: Record) -> None:
    """Let the task scale fall at once and come back slowly, fast in mode REJECT; say what lowered it."""
    if wanted < reaction.task_scale:
        reaction.task_scale, reaction.scale_reason = wanted, reason
    else:
        gain = step.reject_recover_gain if mode == REJECT else step.recover_gain
        reaction.task_scale += gain * (wanted - reaction.task_scale)
    if reaction.task_scale > WHOLE:
        reaction.scale_reason = reason


@inlined
def follow_posture_scale(reaction: Record, mode: int, recover_gain: float, params: Record) -> None:
    """Let the posture's stiffness go in contact and come back slowly: (21) alone gives it back at once."""
    if mode == FREE:
        reaction.posture_scale += recover_gain * (1.0 - reaction.posture_scale)
    else:
        reaction.posture_scale = params.posture_scale


@inlined
def tool_task_scale(F_spring: Vector, force: Vector, contact_n: float, limit_n: float) -> tuple[float, int]:
    """Return the task scale with which the tool presses within a bound on what it touches, and its reason.

    Args:
        F_spring: task stiffness force, (6,), N and N m.
        force: of the environment on the tool, (3,), N.
        contact_n: least force that counts as contact, N; from twice as much on the bound is in force, between the two
            it comes down from infinity.
        limit_n: the bound, N.

    Returns:
        0 … 1; 1 without contact, or where the task presses less than the bound. And a key of LIMITS, 0 for none.
    """
    size = math.sqrt(dot(force, force))
    if size < contact_n:
        return 1.0, 0
    pressed = -dot(force, F_spring[:3]) / size * min((size - contact_n) / contact_n, 1.0)
    return (1.0, 0) if pressed <= limit_n else (limit_n / pressed, LIMITED_BY_TOOL_FORCE)


@inlined
def compensate_disturbance(J: Matrix, J_bar: Matrix, arm_torque: Vector, out: Vector) -> Vector:
    """Fill −Jᵀ J#ᵀ residual of (18), (n,), N m: what takes from the task what the contact does to the tool."""
    F_arm = matvec_t_into(J_bar, arm_torque, stack_vector(6))
    matvec_t_into(J, F_arm, out)
    for i in range(out.shape[0]):
        out[i] = -out[i]
    return out


@inlined
def bound_compensation(compensation: Vector, direction: Vector, M_inv: Matrix, limit: float) -> float:
    """Scale a compensation in place so that it presses within a bound; return what it asked for, N m."""
    asked = torque_against_contact(direction, M_inv, compensation)
    if asked > limit:
        for i in range(compensation.shape[0]):
            compensation[i] *= limit / asked
    return asked


@inlined
def scale_of_task(elastic_push: float, left: float, scale: float, reason: int) -> tuple[float, int]:
    """Return the task scale with which the elastic part presses within what is left of a bound; its reason."""
    if elastic_push > 0.0 and left / elastic_push < scale:
        return left / elastic_push, LIMITED_BY_CONTACT
    return scale, reason


@inlined
def remove_excess(tau: Vector, direction: Vector, M_inv: Matrix, limit: float) -> None:
    """Take off a command in place what it presses along the contact beyond a bound, a (s − s_max)."""
    excess = torque_against_contact(direction, M_inv, tau) - limit
    if excess > 0.0:
        for i in range(tau.shape[0]):
            tau[i] += excess * direction[i]


@inlined
def damp_approach(
    tau: Vector, direction: Vector, qd: Vector, M: Matrix, joint_damping: Vector, rate: float, damping: float
) -> None:
    """Brake motion into an obstacle in place, −d min(a · q̇, 0) a, no more than the sampled loop takes.

    Args:
        tau: command less c and g, (n,), N m; updated.
        direction: a, of the contact's torque on the arm, (n,).
        qd: (n,), rad/s.
        M: joint inertia, (n, n), kg m².
        joint_damping: that acts already, (n,), N m s/rad.
        rate: largest damping per inertia of all of it, 1/s.
        damping: d, N m s/rad.
    """
    approach = min(dot(direction, qd), 0.0)
    if approach < 0.0 and damping > 0.0:
        d = min(damping, braking_limit(direction, M, joint_damping, rate))
        for i in range(tau.shape[0]):
            tau[i] -= d * approach * direction[i]


@inlined
def damp_contact(damping: Vector, N_removed: Matrix, qd: Vector, scale: Vector, params: Record) -> None:
    """Add damping in the null-space direction that the contact takes out, and in all joints, in place.

    Args:
        damping: (n,), N m; updated.
        N_removed: N_t − N_ct, (n, n).
        qd: (n,), rad/s.
        scale: of each joint's damping, (n,).
        params: of reaction.
    """
    n = qd.shape[0]
    scaled, in_null = stack_vector(n), stack_vector(n)
    for i in range(n):
        scaled[i] = scale[i] * qd[i]
    matvec_t_into(N_removed, scaled, in_null)
    for i in range(n):
        damping[i] -= params.null_damping * in_null[i]
        damping[i] -= params.contact_damping * scale[i] * qd[i]
