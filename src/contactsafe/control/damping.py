"""How much damping a sampled loop takes: what is N m s/rad for a heavy joint is a hammer for a light one.

A damper that is computed every tick from a velocity some ticks old brakes what moved then. On an inertia m it is stable
below β m/dt and no further, β depending on the delay alone; `docs/concepts/damping.md` derives it.
"""

import math

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, matmul_into, matvec_into, spd_inverse
from contactsafe.core.stack import stack_matrix, stack_vector

GAIN_MARGIN = 2.0
"""By how much dampers stay below what would be unstable; for what model and delay are not known to be."""

BRAKING_MARGIN = 1.5
"""The same with braking into a contact on top, which acts for moments and in one direction."""


def largest_damping(delay_ticks: float) -> float:
    """Return β, the damping that a sampled unit inertia just takes, in inertias per tick.

    v ← v − β v(d ticks ago) has the characteristic equation z^(d+1) − z^d + β = 0; its roots meet the unit circle at
    β = 2 sin(π/(2 (2 d + 1))).

    Args:
        delay_ticks: d ≥ 0, from the measurement of a velocity to the torque that it calls for, beyond the tick itself.
    """
    return 2.0 * math.sin(math.pi / (2.0 * (2.0 * delay_ticks + 1.0)))


@compiled
def joint_damping_limits(M_inv: Matrix, rate: float, out: Vector) -> None:
    """Fill what each joint's damper may be at most, all of them at once, (n,), N m s/rad.

    D_i = rate w_i / (|M⁻¹| w)_i for any w > 0 gives D |M⁻¹| w = rate w, so that by Perron and Frobenius no eigenvalue
    of M⁻¹ D exceeds `rate`, however joints are coupled. With w_i = (M⁻¹)_ii^(−1/2) a joint that is coupled to none gets
    rate/(M⁻¹)_ii.

    Args:
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        rate: largest eigenvalue allowed, 1/s.
        out: (n,); filled.
    """
    n = out.shape[0]
    w = stack_vector(n)
    for i in range(n):
        w[i] = 1.0 / math.sqrt(M_inv[i, i])
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += abs(M_inv[i, j]) * w[j]
        out[i] = rate * w[i] / s


@compiled
def loosen_limits(M_inv: Matrix, rate: float, limits: Vector) -> None:
    """Raise limits of `joint_damping_limits` in place, all alike, by what the signs of M⁻¹ leave.

    With S = D^½ M⁻¹ D^½ the largest eigenvalue of M⁻¹ D is at most (tr S⁸)^(1/8), which is
    at most n^(1/8) times it.

    Args:
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        rate: largest eigenvalue allowed, 1/s.
        limits: D, (n,), N m s/rad; updated.
    """
    n = limits.shape[0]
    S, S2 = stack_matrix(n, n), stack_matrix(n, n)
    for i in range(n):
        for j in range(n):
            S[i, j] = M_inv[i, j] * math.sqrt(limits[i] * limits[j]) / rate
    matmul_into(S, S, S2)
    matmul_into(S2, S2, S)
    total = 0.0
    for i in range(n):
        total += dot(S[i], S[i])
    largest = total**0.125
    if largest < 1.0:
        for i in range(n):
            limits[i] /= largest


@compiled
def scale_damping_into(damping: Vector, limits: Vector, out: Vector) -> None:
    """Fill the fraction of its damping that every joint may have, (n,), 0 … 1.

    Args:
        damping: all that is asked of a joint, (n,), N m s/rad.
        limits: of `joint_damping_limits`, (n,), N m s/rad.
        out: (n,); filled.
    """
    for i in range(out.shape[0]):
        out[i] = 1.0 if damping[i] <= limits[i] else limits[i] / damping[i]


@compiled
def task_damping_into(K: Vector, D: Vector, delay_s: float, out: Vector) -> Vector:
    """Fill the damping of the task, (6,), 1/s: what is asked, and at least twice what the delay takes away.

    A spring that acts late by τ drives what it holds, as a damper of −K τ would.

    Args:
        K, D: in force, (6,), 1/s² and 1/s.
        delay_s: τ, s.
        out: (6,); filled and given back.
    """
    for i in range(6):
        out[i] = max(D[i], 2.0 * delay_s * K[i])
    return out


@compiled
def braking_limit(direction: Vector, M: Matrix, joint_damping: Vector, rate: float) -> float:
    """Return what may be braked with along one direction beside dampers of the joints, N m s/rad.

    rate M − D − d a aᵀ ⪰ 0 holds up to d = 1/(aᵀ G⁻¹ a) with G = rate M − D.

    Args:
        direction: a, (n,).
        M: joint inertia, (n, n), kg m².
        joint_damping: D, (n,), N m s/rad, with no eigenvalue of M⁻¹ D above `rate`.
        rate: largest eigenvalue allowed of all of it, 1/s.
    """
    n = direction.shape[0]
    G, G_inv = stack_matrix(n, n), stack_matrix(n, n)
    for i in range(n):
        for j in range(n):
            G[i, j] = rate * M[i, j]
        G[i, i] -= joint_damping[i]
    if not spd_inverse(G, G_inv):
        return 0.0
    return 1.0 / dot(direction, matvec_into(G_inv, direction, stack_vector(n)))
