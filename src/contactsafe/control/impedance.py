"""The free-space law (17): task impedance and posture, elastic parts kept apart from damping parts.

What acts towards a target (stiffness, posture) is elastic: the task scale lowers it. What damps is never lowered.
"""

import math

import numpy as np

from contactsafe.control.codes import FREE
from contactsafe.control.damping import (
    joint_damping_limits,
    loosen_limits,
    scale_damping_into,
    task_damping_into,
)
from contactsafe.control.laws import damping_wrench, stiffness_wrench
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import matvec_t_into, shorten
from contactsafe.core.stack import stack_vector
from contactsafe.robot.friction import DRY_STEEP

_f = np.float64


def impedance_dtype(n: int) -> np.dtype:
    """Describe the gains in force."""
    return np.dtype(
        [
            ("K_task", _f, (6,)),  # 1/s²
            ("D_task", _f, (6,)),  # 1/s
            ("task_damping", _f),  # largest of the task's, 1/s
            ("damping_limit", _f, (n,)),  # what dampers of each joint may come to, N m s/rad
            ("joint_damping", _f, (n,)),  # what they come to, N m s/rad
            ("damping_scale", _f, (n,)),  # of each joint's damping in force
        ]
    )


_LEAST_STIFFNESS = 10.0
"""From which a direction that was let go comes back, 1/s²."""


@compiled
def passive_step(
    K: Vector, D: Vector, K_wanted: Vector, D_wanted: Vector, dt: float, damping_min: float, limited: bool
) -> None:
    """Move stiffness and damping in place towards what is wanted, no faster than keeps the impedance stable.

    Unit inertia, stiffness K, damping D ≥ α: K̇ + α Ḋ ≤ 2 α K suffices (Kronander & Billard 2016), each axis by
    itself. Falling gains are free. A direction that was let go, K = 0, starts as from the least stiffness, or it would
    never come back.

    Args:
        K, D: in force, (6,), 1/s² and 1/s; updated.
        K_wanted, D_wanted: (6,).
        dt: tick, s.
        damping_min: α, least damping that may ever be asked for, 1/s.
        limited: whether to limit at all.
    """
    for i in range(6):
        rise = K_wanted[i] - K[i] + damping_min * (D_wanted[i] - D[i])
        most = 2.0 * damping_min * max(K[i], _LEAST_STIFFNESS) * dt
        fraction = most / rise if limited and rise > most else 1.0
        K[i] += fraction * (K_wanted[i] - K[i])
        D[i] += fraction * (D_wanted[i] - D[i])


@inlined
def follow_gains(impedance: Record, target: Record, dt: float, params: Record) -> None:
    """Move the gains in force towards those of the target."""
    passive_step(
        impedance.K_task, impedance.D_task, target.K_task, target.D_task, dt, params.damping_range[0],
        params.passive_gains != 0,
    )  # fmt: skip


@inlined
def task_wrenches(
    impedance: Record, Lambda: Matrix, error: Vector, dynamics: Record, delay_s: float, params: Record
) -> tuple[Vector, Vector]:
    """Return elastic and damping wrench at the tool, (5), (6,) each, N and N m; and note the largest damping.

    Args:
        impedance: `impedance_dtype` record; its `task_damping` is set.
        Lambda: task inertia, (6, 6).
        error: x_d − x, (6,), m and rad.
        dynamics: `dynamics_dtype` record.
        delay_s: of the loop, s.
        params: of impedance.
    """
    F_spring = stiffness_wrench(
        Lambda, error, impedance.K_task, params.task_acceleration_max_m_s2, params.task_acceleration_max_rad_s2
    )
    D_task = task_damping_into(impedance.K_task, impedance.D_task, delay_s, stack_vector(6))
    impedance.task_damping = D_task.max()
    velocity, acceleration = stack_vector(6), stack_vector(6)
    for i in range(6):
        velocity[i] = dynamics.velocity[i] + dynamics.carried_velocity[i]
        acceleration[i] = dynamics.Jdot_qd[i] + dynamics.carried_acceleration[i]
    return F_spring, damping_wrench(Lambda, velocity, acceleration, D_task)


@inlined
def set_joint_damping(impedance: Record, mode: int, M_inv: Matrix, params: Record) -> None:
    """Set the part of each joint's damping that its inertia takes beside the damping of the task.

    Args:
        impedance: `impedance_dtype` record; updated.
        mode: in contact more damping is asked for.
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        params: `params_dtype` record.
    """
    reaction, rate = params.reaction, params.limits.damping_rate - impedance.task_damping
    joint_damping_limits(M_inv, rate, impedance.damping_limit)
    impedance.joint_damping[:] = params.impedance.D_posture
    if mode != FREE:
        for i in range(impedance.joint_damping.shape[0]):
            posture = max(params.impedance.D_posture[i], reaction.null_damping)
            impedance.joint_damping[i] = posture + reaction.contact_damping
    if (impedance.joint_damping > impedance.damping_limit).any():
        loosen_limits(M_inv, rate, impedance.damping_limit)
    scale_damping_into(impedance.joint_damping, impedance.damping_limit, impedance.damping_scale)
    for i in range(impedance.joint_damping.shape[0]):
        impedance.joint_damping[i] *= impedance.damping_scale[i]


@inlined
def posture_torques_into(
    impedance: Record, arm: Record, q_posture: Vector, scale: float, params: Record, elastic: Vector, damping: Vector
) -> None:
    """Fill elastic and damping torque of the posture task, K2 (q_d − q) and −D2 q̇, (15), (n,) each, N m.

    Args:
        impedance: `impedance_dtype` record.
        arm: joints of the state.
        q_posture: q_d, (n,), rad.
        scale: of the stiffness in force.
        params: `params_dtype` record.
        elastic, damping: (n,), N m; filled.
    """
    known, delay_s = params.impedance, params.clock.loop_delay_s
    for i in range(elastic.shape[0]):
        elastic[i] = q_posture[i] - arm.q[i]
    shorten(elastic, known.posture_error_max_rad)
    for i in range(elastic.shape[0]):
        D = impedance.damping_scale[i] * known.D_posture[i]
        elastic[i] *= scale * min(known.K_posture[i], D / (2.0 * delay_s))
        damping[i] = -D * arm.qd[i]


OVERCOME_FRACTION = 0.9
"""Of the friction that a file declares and no compensation by velocity takes off: less than holds a joint by itself."""

MOST_GAIN = 9.0
"""Times what is asked for that is added at most."""

_FAST_RAD_S = 1.0
"""At such a speed nothing is stuck."""


@inlined
def friction_gain(K_task: Vector, D_task: Vector, delay_s: float) -> float:
    """Return how many times a small error's torque may be added to it: D ≥ 2 τ (1 + gain) K, each axis by itself.

    As `task_damping_into` has it of the stiffness that is asked for: a spring that acts later drives what it holds.

    Args:
        K_task, D_task: in force, (6,), 1/s² and 1/s.
        delay_s: τ of the loop, s.
    """
    gain = MOST_GAIN
    for i in range(6):
        if K_task[i] > 0.0:
            gain = min(gain, D_task[i] / (2.0 * delay_s * K_task[i]) - 1.0)
    return max(gain, 0.0)


@inlined
def overcome_friction(elastic: Vector, task: Vector, qd: Vector, gain: float, arm: Record) -> None:
    """Add to an elastic torque in place what friction is known to keep from the links: in the direction of the task's.

    At rest the velocity does not say in which direction friction acts, and a light joint must not be driven by all of
    it, but it is against what would move the joint. Added is a multiple of what the task asks for, up to a part of the
    friction that is not compensated: never more than holds the joint by itself.

    Args:
        elastic: of task and posture, (n,), N m; updated.
        task: of the task alone, (n,), N m.
        qd: (n,), rad/s.
        gain: see `friction_gain`.
        arm: `arm_dtype` record.
    """
    for i in range(elastic.shape[0]):
        viscous, dry = arm.friction_unknown[i, 0], arm.friction_unknown[i, 1]
        if dry != 0.0 or viscous != 0.0:
            speed = abs(qd[i])
            left = viscous * speed + max(dry - arm.drag[i, 2] * math.tanh(0.5 * DRY_STEEP * speed), 0.0)
            most = OVERCOME_FRACTION * left * (1.0 - math.tanh(speed / _FAST_RAD_S))
            elastic[i] += min(max(gain * task[i], -most), most)


@inlined
def compose_into(J: Matrix, wrench: Vector, N: Matrix, posture: Vector, out: Vector) -> Vector:
    """Fill Jᵀ F + Nᵀ Γ, (n,), N m: a task, and a posture in a null space of it."""
    n = out.shape[0]
    of_task, of_posture = stack_vector(n), stack_vector(n)
    matvec_t_into(J, wrench, of_task)
    matvec_t_into(N, posture, of_posture)
    for i in range(n):
        out[i] = of_task[i] + of_posture[i]
    return out
