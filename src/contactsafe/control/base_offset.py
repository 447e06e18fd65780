"""Offset at the base: what its sensor shows while nothing touches the arm, and how well the rest of it is known.

It has the sensor's bias in it, the weight of the base, and what the links' masses differ from the model. Weight is the
same force in every posture; its moment is not, and changes by what is not identified of the masses.
"""

import math

from contactsafe.control.laws import filter_gain
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, matvec_into
from contactsafe.core.stack import stack_matrix, stack_vector
from contactsafe.robot.base_dynamics import weight_moment_regressor

_MEMORY_1_S, _LEARNED_S = 0.5, 0.25
"""Of the offset, as of the joints' baseline; before that nothing is told."""

_SHOWS, _DOUBTED_1_S = 4.0, 0.1
"""What exceeds so many standard deviations may be a contact that the joints do not feel: it is learned within 10 s."""

_LEAST_N, _LEAST_NM, _SCALE = 0.2, 0.1, 0.01
"""Standard deviations beside the scatter that was seen: of force, of moment, and as a fraction of either."""

_ELSEWHERE_NM = 0.2
"""Of the moment far from where the offset was learned: of centres of mass that are not quite where the model says."""

_MODEL_SIGMAS = 2.0
"""The model's uncertainty is taken for so many standard deviations."""


@compiled
def follow_base_change(base: Record, handle: Record, state: Record, params: Record, untouched: bool) -> None:
    """Learn the offset while nothing touches; set what the base shows beyond it, and how well that is known.

    Args:
        base, handle, state, params: as of `observe_base`.
        untouched: whether nothing touches arm or tool.
    """
    if base.started == 0:
        return
    n = state.arm.q.shape[0]
    regressor = stack_matrix(3, n + 1)
    weight_moment_regressor(handle, regressor)
    if state.arm.has_wrench != 0:
        regressor[:, n] = 0.0  # the tool's own weight shows in its wrench and cancels
    if untouched:
        _learn(base, regressor, state.step.dt)
    base.told = 1 if base.seconds > _LEARNED_S else 0
    elsewhere = (1.0 - state.baseline.weight) * _ELSEWHERE_NM
    for k in range(6):
        found, left, least = 0.0, 0.0, _LEAST_N
        if k >= 3:
            found, left = _of_masses(regressor[k - 3], base.regressor[k - 3], state.link_masses)
            left, least = left + elsewhere * elsewhere, _LEAST_NM
        changed = base.residual[k] - base.offset[k] - found
        model = params.detection.inertia_uncertainty * base.rate[k] / _MODEL_SIGMAS
        variance = least * least + base.variance[k] + model * model + left
        base.wrench[k], base.sigma[k] = changed, math.sqrt(variance + (_SCALE * changed) ** 2)


@compiled
def _learn(base: Record, regressor: Matrix, dt: float) -> None:
    base.seconds += dt
    if base.seconds <= 0.0:
        return
    gain = min(max(filter_gain(_MEMORY_1_S, dt), dt / base.seconds), 1.0)
    doubted = base.told != 0 and _shows(base)
    if doubted:
        gain = filter_gain(_DOUBTED_1_S, dt)
    for k in range(6):
        news = base.residual[k] - base.offset[k]
        base.offset[k] += gain * news
        if not doubted:
            base.variance[k] += gain * ((1.0 - gain) * news * news - base.variance[k])
    for k in range(3):
        for link in range(regressor.shape[1]):
            base.regressor[k, link] += gain * (regressor[k, link] - base.regressor[k, link])


@compiled
def _shows(base: Record) -> bool:
    for k in range(6):
        if abs(base.wrench[k]) > _SHOWS * base.sigma[k]:
            return True
    return False


@compiled
def _of_masses(here: Vector, there: Vector, masses: Record) -> tuple[float, float]:
    """Return by how much the moment of weight differs from that where the offset was learned, beside the model's.

    Returns:
        The difference by the masses as identified, N m, and the variance of what is not identified of it, N² m².
    """
    difference = stack_vector(here.shape[0])
    for link in range(here.shape[0]):
        difference[link] = here[link] - there[link]
    spread = matvec_into(masses.covariance, difference, stack_vector(here.shape[0]))
    return dot(difference, masses.mass_error), max(dot(difference, spread), 0.0)
