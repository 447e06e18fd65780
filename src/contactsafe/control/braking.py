"""An arm that is too fast: how near it is to that, and what brakes all of it, no faster than its motors can follow."""

import math

from contactsafe.control.damping import joint_damping_limits
from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import matvec_into
from contactsafe.core.stack import stack_vector

_HASTE = 0.8
"""Fraction of what is too fast from which the brake takes over, gradually."""

_USABLE = 0.25
"""Of torque and torque rate that each of the two brakes may use; the rest is for gravity and what they do not know."""


@compiled
def braking_fraction(qd: Vector, speed: Vector, c: Vector, speed_max: Vector, tau_max: Vector) -> float:
    """Return how much of a command a brake must replace, 0 … 1: all of it where the arm is too fast.

    That is where a joint is as fast as its limit, or will be before the torque that drives it can be taken off, or
    where the arm's motion by itself asks a motor for half of its torque.

    Args:
        qd, speed: now, and by then, (n,), rad/s; see `joint_stops.predict_velocity`.
        c: Coriolis and centrifugal torque, (n,), N m; grows with the square of speed.
        speed_max: (n,), rad/s.
        tau_max: (n,), N m.
    """
    fast, driven = 0.0, 0.0
    for i in range(qd.shape[0]):
        fast = max(fast, max(abs(qd[i]), abs(speed[i])) / speed_max[i])
        driven = max(driven, 2.0 * abs(c[i]) / tau_max[i])
    haste = max(fast, math.sqrt(driven))
    return min(max((haste - _HASTE) / (1.0 - _HASTE), 0.0), 1.0)


@compiled
def brake_into(
    M: Matrix, M_inv: Matrix, qd: Vector, tau_max: Vector, torque_rate: float, rate: float, out: Vector
) -> Vector:
    """Fill what brakes the whole arm, −ν M q̇ − D q̇, (n,), N m, and return it.

    The first brakes all joints alike and flings none; the second each by itself, what is light fast. Neither can ever
    feed energy, and both are as fast as a sampled loop and the motors can follow: see `_followed`.

    Args:
        M: joint inertia, (n, n), kg m².
        M_inv: its inverse, 1/(kg m²).
        qd: (n,), rad/s.
        tau_max: (n,), N m.
        torque_rate: N m/s.
        rate: largest eigenvalue allowed of both, 1/s.
        out: (n,); filled.
    """
    n = qd.shape[0]
    momentum = matvec_into(M, qd, out)
    damping = stack_vector(n)
    joint_damping_limits(M_inv, 0.5 * rate, damping)
    alike = 0.5 * rate
    for i in range(n):
        alike = min(alike, _followed(abs(momentum[i]), tau_max[i], torque_rate))
    for i in range(n):
        inertia = 1.0 / M_inv[i, i]
        alone = inertia * _followed(inertia * abs(qd[i]), tau_max[i], torque_rate)
        out[i] = -alike * momentum[i] - min(alone, damping[i]) * qd[i]
    return out


@compiled
def _followed(momentum: float, tau_max: float, torque_rate: float) -> float:
    """Return the rate at which a motor whose torque changes no faster than `torque_rate` can brake a momentum, 1/s.

    p' = −√(2 s r p) asks for the torque rate s r until it rests. A brake that asks for more lags behind
    itself, and drives: were it stiff, τ' = −r sign(v) would swing an inertia for ever.
    """
    if momentum == 0.0:
        return math.inf
    return min(math.sqrt(2.0 * _USABLE * torque_rate / momentum), _USABLE * tau_max / momentum)
