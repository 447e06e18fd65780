"""Reaction: which mode a contact asks for, and the parts of the contact-aware law (18), (21), (22).

Mode FREE leaves the impedance alone; COMPLY recedes from an obstacle; REJECT resists a push. `contact_bound` keeps what
comes of it within the bound on the commanded contact force.
"""

import math

import numpy as np

from contactsafe.control.codes import COMPLY, FREE, OBSTACLE, PUSH, REJECT
from contactsafe.control.damping import braking_limit
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot, matvec_into, matvec_t_into
from contactsafe.core.stack import stack_vector

_f = np.float64
_i = np.int64

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
def react(reaction: Record, mode: int, shown: int, torque_nm: float, limit_nm: float, dt: float, params: Record) -> int:
    """Return the mode that what a contact has shown asks for, and let the bounds in force fall.

    Args:
        reaction: `reaction_dtype` record; its bounds are updated.
        mode: so far, COMPLY or REJECT.
        shown: what `classify` returned.
        torque_nm: of the contact along its direction, N m.
        limit_nm: bound with which mode REJECT begins, N m.
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
        mode, reaction.reject_limit_nm = REJECT, limit_nm
    elif shown == OBSTACLE:
        mode, reaction.reject_decay_s, reaction.reject_limit_nm, reaction.initial_limit_n = COMPLY, 0.0, 0.0, 0.0
    if mode == REJECT:
        reaction.reject_limit_nm *= 1.0 - dt / reaction.reject_decay_s
    return mode


@inlined
def follow_posture_scale(reaction: Record, mode: int, recover_gain: float, params: Record) -> None:
    """Let the posture's stiffness go in contact and come back slowly: (21) alone gives it back at once."""
    if mode == FREE:
        reaction.posture_scale += recover_gain * (1.0 - reaction.posture_scale)
    else:
        reaction.posture_scale = params.posture_scale


@inlined
def compensate_disturbance(J: Matrix, J_bar: Matrix, arm_torque: Vector, out: Vector) -> Vector:
    """Fill −Jᵀ J#ᵀ residual of (18), (n,), N m: what takes from the task what the contact does to the tool."""
    F_arm = matvec_t_into(J_bar, arm_torque, stack_vector(6))
    matvec_t_into(J, F_arm, out)
    for i in range(out.shape[0]):
        out[i] = -out[i]
    return out


@inlined
def damp_approach(
    tau: Vector, direction: Vector, qd: Vector, gone: bool, M: Matrix, damped: Vector, rate: float, damping: float
) -> None:
    """Brake motion into an obstacle in place, −d min(a · q̇, 0) a, no more than the sampled loop takes.

    Where it seems to be gone motion away from it is braked too: an arm that has let its task go would drift on.

    Args:
        tau: command less c and g, (n,), N m; updated.
        direction: a, of the contact's torque on the arm, (n,).
        qd: (n,), rad/s.
        gone: whether nothing has pressed for a while.
        M: joint inertia, (n, n), kg m².
        damped: damping of the joints that acts already, (n,), N m s/rad.
        rate: largest damping per inertia of all of it, 1/s.
        damping: d, N m s/rad.
    """
    speed = dot(direction, qd)
    if damping > 0.0 and (speed < 0.0 or gone):
        d = min(damping, braking_limit(direction, M, damped, rate))
        for i in range(tau.shape[0]):
            tau[i] -= d * speed * direction[i]


@inlined
def damp_contact(
    damping: Vector, mode: int, N_t: Matrix, N_ct: Matrix, qd: Vector, scale: Vector, params: Record
) -> None:
    """Add damping in the null-space direction that the contact takes out, and in all joints, in place.

    In mode REJECT the task goes on: what damps the joints is kept out of it, or a tool that moves would be late.

    Args:
        damping: (n,), N m; updated.
        mode: COMPLY or REJECT.
        N_t, N_ct: null-space projectors of the task, and of task and contact, (n, n).
        qd: (n,), rad/s.
        scale: of each joint's damping, (n,).
        params: of reaction.
    """
    n = qd.shape[0]
    scaled, in_null, beside_contact = stack_vector(n), stack_vector(n), stack_vector(n)
    for i in range(n):
        scaled[i] = scale[i] * qd[i]
    matvec_t_into(N_t, scaled, in_null)
    matvec_t_into(N_ct, scaled, beside_contact)
    if mode == REJECT:
        _keep_out_of_task(N_t, qd, scale, scaled)
    for i in range(n):
        damping[i] -= params.null_damping * (in_null[i] - beside_contact[i]) + params.contact_damping * scaled[i]


@inlined
def _keep_out_of_task(N_t: Matrix, qd: Vector, scale: Vector, out: Vector) -> None:
    """Fill N_tᵀ S N_t q̇, (n,): the projector is oblique, and only so nothing of the task's motion drives it."""
    in_null = matvec_into(N_t, qd, stack_vector(qd.shape[0]))
    for i in range(qd.shape[0]):
        in_null[i] *= scale[i]
    matvec_t_into(N_t, in_null, out)
