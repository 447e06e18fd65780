"""Tool in contact: the force that meets the tool while something touches the arm, where no sensor says it.

Compensated as a part of the push it would press the tool into what it meets, the more the more that answers. It differs
from a push that grows: one contact keeps its pattern over the joints, and a force on the tool has a pattern of its own,

    y = α a + J_vᵀ f + e,    a: the contact's torque as it was at first.

α and f are estimated by weighted least squares in every tick; a follows what neither explains, at the size it has had
at most: there it is known best. A push that turns, or that turns as the arm moves, is taken for the tool's in part, and
resisted with less: that is the harmless side of the doubt.
"""

import math

import numpy as np

from contactsafe.control.laws import observer_step
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot, matvec_into, matvec_t_into, spd_inverse
from contactsafe.core.stack import stack_matrix, stack_vector

_f = np.float64

_KNOWN_S = 0.1
"""The pattern is learnt so long; what meets the tool meanwhile is taken for a part of the contact."""

_OTHER = 60.0
"""χ² from which on neither explains the torques: another contact, whose pattern is learnt anew; what was the tool's
stays the tool's meanwhile."""

_LEAST_NM, _UNMEASURED_NM, _PATTERN = 0.1, 0.25, 0.05
"""Standard deviation of a torque beside its noise, of noise where it is not measured, and the fraction of the torque by
which a pattern may be off."""

_PRIOR_N = 40.0
"""Standard deviation of the force on a tool, before the torques are asked, N."""


def tool_in_contact_dtype(n: int) -> np.dtype:
    """Describe what is remembered of a contact of the arm, and of what meets the tool meanwhile."""
    return np.dtype(
        [
            ("pattern", _f, (n,)),  # torque of the arm's contact alone, N m
            ("known_s", _f),  # for which it has been learnt
            ("force", _f, (3,)),  # on the tool beside what was there before, N
            ("force_unfiltered", _f, (3,)),  # behind the first filter of the compensating residual, N
            ("force_slow", _f, (3,)),  # behind its filters, N
        ]
    )


@compiled
def forget_tool_in_contact(known: Record) -> None:
    """Begin with a contact of the arm alone."""
    known.pattern[:], known.known_s = 0.0, 0.0
    known.force[:], known.force_unfiltered[:], known.force_slow[:] = 0.0, 0.0, 0.0


@inlined
def follow_tool_in_contact(known: Record, torque: Vector, noise: Record, J: Matrix, step: Record) -> None:
    """Find the force on the tool beside a contact of the arm.

    Args:
        known: `tool_in_contact_dtype` record; advanced.
        torque: y, the fast residual less what the tool's force of before the contact makes, (n,), N m.
        noise: of the residual, up to date.
        J: task Jacobian, (6, n).
        step: in force.
    """
    n, rest = torque.shape[0], stack_vector(torque.shape[0])
    if known.known_s < _KNOWN_S:
        known.known_s += step.dt
        matvec_t_into(J[:3], known.force, rest)
        gain = min(4.0 * step.dt / known.known_s, 1.0)
        for i in range(n):
            known.pattern[i] += gain * (torque[i] - rest[i] - known.pattern[i])
    else:
        _explain(known, torque, noise, J[:3], rest, step.tool_memory_gain)
    observer_step(known.force_unfiltered, step.compensation_filter_gain, known.force)
    observer_step(known.force_slow, step.lowpass_gain, known.force_unfiltered)


@compiled
def _explain(known: Record, torque: Vector, noise: Record, J_v: Matrix, rest: Vector, gain: float) -> None:
    """Explain a torque by a contact's pattern and a force on the tool; let the pattern follow the rest."""
    n, size = torque.shape[0], math.sqrt(dot(torque, torque))
    A, A_inv, b, x = stack_matrix(4, 4), stack_matrix(4, 4), stack_vector(4), stack_vector(4)
    column, pattern, chi2 = stack_vector(4), known.pattern, 0.0
    A[:], b[:], A[0, 0] = 0.0, 0.0, 1e-6
    for j in range(1, 4):
        A[j, j] = 1.0 / (_PRIOR_N * _PRIOR_N)
    for i in range(n):
        weight = 1.0 / _variance(noise, i, size)
        column[0], column[1], column[2], column[3] = pattern[i], J_v[0, i], J_v[1, i], J_v[2, i]
        for j in range(4):
            b[j] += weight * column[j] * torque[i]
            for k in range(4):
                A[j, k] += weight * column[j] * column[k]
    if not spd_inverse(A, A_inv):
        return
    matvec_into(A_inv, b, x)
    matvec_t_into(J_v, x[1:], rest)
    for i in range(n):
        rest[i] = torque[i] - rest[i] - x[0] * pattern[i]
        chi2 += rest[i] * rest[i] / _variance(noise, i, size)
    if chi2 > _OTHER:
        known.known_s = 0.0
        return
    known.force[:] = x[1:]
    scale = max(x[0], 1.0)
    for i in range(n):
        pattern[i] = scale * pattern[i] + gain * rest[i]


@inlined
def _variance(noise: Record, i: int, size: float) -> float:
    """Return the variance of joint i's torque, (N m)², where all of them have a size of so much, N m."""
    sigma = noise.bandwidth * noise.sigma[i] if noise.sigma[i] > 0.0 else _UNMEASURED_NM
    return _LEAST_NM**2 + sigma * sigma + (_PATTERN * size) ** 2
