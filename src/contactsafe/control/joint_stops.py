"""Joint stops: no joint leaves its range or goes beyond its speed limit, whatever is asked."""

import math

import numpy as np

from contactsafe.control.damping import joint_damping_limits
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot, matvec_into, spd_inverse
from contactsafe.core.stack import stack_matrix, stack_vector

_f = np.float64

_RELEASE_RAD_S2 = 100.0
"""Acceleration by which a joint may be let go when its own torque is taken off, rad/s²."""

_FADE_RAD_S = 0.4
"""Excess of speed at which nothing drives a joint on any more, rad/s."""


def stops_dtype(n: int) -> np.dtype:
    """Describe what the joint stops do in a tick."""
    return np.dtype(
        [
            ("speed", _f, (n,)),  # that a joint will have reached when the torque that drives it is off, rad/s
            ("horizon", _f, (n,)),  # time until that torque is off, s
            ("excess", _f, (n,)),  # of speed, positive where it moves up, rad/s
            ("intrusion", _f, (n,)),  # into the margin, positive at the upper end, rad
            ("brake", _f, (n,)),  # per excess of speed, N m s/rad
            ("spring", _f, (n,)),  # per intrusion, N m/rad
            ("drag", _f, (n,)),  # of motion out of the margin, N m s/rad
        ]
    )


@inlined
def predict_velocity(
    stops: Record, qd: Vector, M_inv: Matrix, momentum_rate: Vector, step_max: float, dt: float
) -> None:
    """Fill the speed that joints will have before the torque that drives them can be taken off, and the horizon.

    A command falls by `step_max` a tick at most: until it is gone it goes on accelerating, by half of it on average.

    Args:
        stops: `stops_dtype` record; `speed` and `horizon` are filled.
        qd: (n,), rad/s.
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        momentum_rate: torque that drives the arm, whatever it comes from, (n,), N m.
        step_max: N m per tick.
        dt: tick, s.
    """
    n = qd.shape[0]
    impulse = stack_vector(n)
    for i in range(n):
        stops.horizon[i] = abs(momentum_rate[i]) * (dt / step_max)
        impulse[i] = 0.5 * momentum_rate[i] * stops.horizon[i]
    matvec_into(M_inv, impulse, stops.speed)
    for i in range(n):
        stops.speed[i] += qd[i]


@inlined
def joint_excess(stops: Record, q: Vector, qd: Vector, arm: Record, margin: float, deceleration: float) -> bool:
    """Fill by how much each joint is too fast and too far, signed by its direction; tell whether any is.

    A joint may move no faster than it can be stopped before a margin of its range, √(2 a d), nor than its speed limit;
    what counts is the speed that it will have before the torque that drives it can be taken off.

    Args:
        stops: `stops_dtype` record, predicted; `excess` and `intrusion` are filled.
        q, qd: (n,), rad and rad/s.
        arm: `arm_dtype` record: its range `q_min`, `q_max` and speed limits `qd_max`.
        margin: rad.
        deceleration: a, rad/s².
    """
    some = False
    for i in range(q.shape[0]):
        sign = 1.0 if stops.speed[i] > 0.0 else -1.0
        room = (arm.q_max[i] - q[i] if sign > 0.0 else q[i] - arm.q_min[i]) - margin
        room -= max(sign * qd[i], 0.0) * stops.horizon[i]
        allowed = min(arm.qd_max[i], math.sqrt(2.0 * deceleration * max(room, 0.0)))
        stops.excess[i] = sign * max(sign * stops.speed[i] - allowed, 0.0)
        stops.intrusion[i] = max(q[i] - arm.q_max[i] + margin, 0.0)
        if stops.intrusion[i] == 0.0:
            stops.intrusion[i] = min(q[i] - arm.q_min[i] - margin, 0.0)
        some = some or stops.excess[i] != 0.0 or stops.intrusion[i] != 0.0
    return some


@compiled
def joint_stop_gains(
    stops: Record, M: Matrix, damping: Vector, rate: float, gain: float, stiffness: float, delay_s: float
) -> None:
    """Fill what the joint stops may brake and push back with, kept within what those joints take (`control.damping`).

    The brake is in proportion to the inertia that the joint moves. A spring behind a delay feeds energy into the joint:
    it is kept so soft that half of the damping there is takes that energy out again. The drag is this damping, for
    joints that are not braked. Joints without excess and intrusion get none.

    Args:
        stops: `stops_dtype` record; `brake`, `spring` and `drag` are filled.
        M: joint inertia, (n, n), kg m².
        damping: that acts on each joint already, (n,), N m s/rad.
        rate: largest eigenvalue allowed of all of it, 1/s.
        gain: braking per excess of speed, 1/s.
        stiffness: N m/rad of intrusion.
        delay_s: of the loop, s.
    """
    n = damping.shape[0]
    left, left_inv, most = stack_matrix(n, n), stack_matrix(n, n), stack_vector(n)
    for i in range(n):
        for j in range(n):
            left[i, j] = rate * M[i, j]
        left[i, i] -= damping[i]
    if not spd_inverse(left, left_inv):
        left_inv[:] = 0.0
    for i in range(n):
        if stops.excess[i] == 0.0 and stops.intrusion[i] == 0.0:
            left_inv[i, :], left_inv[:, i] = 0.0, 0.0
            left_inv[i, i] = 1.0
    joint_damping_limits(left_inv, 1.0, most)
    for i in range(n):
        stopped = stops.excess[i] != 0.0 or stops.intrusion[i] != 0.0
        stops.brake[i] = min(gain * M[i, i], most[i]) if stopped else 0.0
        stops.spring[i] = min(stiffness, (damping[i] + stops.brake[i]) / (2.0 * delay_s)) if stopped else 0.0
        stops.drag[i] = min(2.0 * delay_s * stops.spring[i], stops.brake[i])


@compiled
def joint_stop_torque(stops: Record, tau_net: Vector, M_inv: Matrix, qd: Vector, margin: float) -> None:
    """Keep joints in their range and below their speed limits, in place; away from both nothing changes.

    What is too fast is braked, and what drives it on fades; within the margin a spring pushes back, damped on the
    return as well. What drives a joint on is its own torque, or the acceleration that the whole command gives it, as a
    torque of its own, (M⁻¹ τ)_i/(M⁻¹)_ii, whichever is more. Its own counts up to `_RELEASE_RAD_S2` of the inertia that
    the joint moves alone: on a chain of parallel axes it may be just what holds the joint against all the others.

    Args:
        stops: `stops_dtype` record, its gains filled.
        tau_net: command less gravity and Coriolis torque, (n,), N m; updated.
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        qd: (n,), rad/s.
        margin: rad.
    """
    for i in range(qd.shape[0]):
        excess, intrusion = stops.excess[i], stops.intrusion[i]
        if excess == 0.0 and intrusion == 0.0:
            continue
        inertia = 1.0 / M_inv[i, i]
        driven, change = inertia * dot(M_inv[i], tau_net), 0.0
        if excess != 0.0:
            sign = 1.0 if excess > 0.0 else -1.0
            on = max(min(sign * tau_net[i], _RELEASE_RAD_S2 * inertia), sign * driven, 0.0)
            change = -sign * on * min(sign * excess / _FADE_RAD_S, 1.0) - stops.brake[i] * excess
        if intrusion != 0.0:
            out = 1.0 if intrusion > 0.0 else -1.0
            on = max(min(out * (tau_net[i] + change), _RELEASE_RAD_S2 * inertia), out * (driven + change), 0.0)
            change -= out * on * min(out * intrusion / margin, 1.0)
            change -= stops.spring[i] * intrusion + out * stops.drag[i] * min(out * qd[i], 0.0)
        tau_net[i] += change
