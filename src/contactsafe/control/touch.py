"""Touch: whether anything touches the arm or its tool, which of the two, and where, whatever the laws make of it."""

import math

import numpy as np

from contactsafe.control.baseline import follow_baseline
from contactsafe.control.codes import FREE, NO_CONTACT, OBSTACLE, PUSH, REJECT, TOOL
from contactsafe.control.detection import GRAVITY_SIGMAS
from contactsafe.control.evidence import Uncertainty, moment_variance
from contactsafe.control.localisation import forget_place, localise
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import inlined
from contactsafe.core.linalg import dot
from contactsafe.core.stack import stack_vector

_f = np.float64
_i = np.int64

_TOOL_PRIOR, _TOOL_PRIOR_SEEN, _NEVER_TOOL = 0.4, 0.02, 1e-6
"""Probability that what touches is at the tool, before anything is known; where a sensor takes that out; and where
detection has told that it is the arm."""

_QUIET_S = 0.02
"""A touch ends after so long below what keeps it."""

_LEAST_NM, _ELSEWHERE_NM, _SCALE = 0.05, 0.2, 0.02
"""Standard deviation of a residual beside noise: anywhere, where no baseline holds, and as a fraction of itself."""

_MODEL_SIGMAS = 2.0
"""The model's uncertainty is taken for so many standard deviations."""

touch_dtype = np.dtype(
    [
        ("touching", _i),
        ("ticks", _i),  # since it began or ended
        ("quiet_ticks", _i),  # since the residual was above what keeps a contact
        ("kind", _i),  # key of KINDS
        ("probability", _f),  # of it
    ]
)
"""What is remembered of whatever touches."""


@inlined
def follow_touch(c: Record) -> None:
    """Tell whether anything touches, and if so where.

    Args:
        c: `controller_dtype` record, its thresholds, mode and tool force up to date.
    """
    state, params = c.state, c.params
    touch, place = state.touch, state.localisation
    n = state.arm.q.shape[0]
    changed, sigma = stack_vector(n), stack_vector(n)
    shows = _change_into(c, changed, sigma)
    ticks = max(round(state.step.ticks), 1)
    touch.ticks += ticks
    touch.quiet_ticks = 0 if shows else touch.quiet_ticks + ticks
    began = touch.touching == 0 and shows
    quiet = touch.quiet_ticks * params.clock.dt > _QUIET_S
    ended = touch.touching != 0 and touch.ticks >= params.detection.dwell_ticks and quiet
    if began or ended:
        touch.touching, touch.ticks = 1 if began else 0, 0
        forget_place(place, state.arm.q)
    if touch.touching != 0 and c.handle.place_points > c.handle.tool_places:
        known = Uncertainty(sigma, moment_variance(changed))
        localise(place, c.handle, changed, known, state.arm.q, _tool_prior(state, params.observer), state.step.dt)
    touch.kind, touch.probability = _kind(touch, place, state, params.classification.tool_contact_n)


@inlined
def _tool_prior(state: Record, params: Record) -> float:
    """Return how probable the tool is before the torques are asked."""
    tells = state.arm.has_wrench != 0 or state.arm.q.shape[0] > 6  # as `separate_tool_wrench` does
    if state.mode != FREE and tells:
        return _NEVER_TOOL
    return _TOOL_PRIOR_SEEN if state.arm.has_wrench != 0 and params.cancel_tool_wrench != 0 else _TOOL_PRIOR


@inlined
def _change_into(c: Record, changed: Vector, sigma: Vector) -> bool:
    """Fill the residual less its baseline, and its standard deviation, (n,), N m; tell whether it shows a touch."""
    state = c.state
    observer, detection, touch, baseline = state.observer, state.detection, state.touch, state.baseline
    follow_baseline(
        baseline, observer.residual_fast, state.arm.q, touch.touching == 0 and state.mode == FREE, state.step.dt
    )
    keep = c.params.detection.release_fraction if touch.touching != 0 else 1.0
    shows = False
    for i in range(changed.shape[0]):
        gravity, model = state.link_masses.gravity_sigma[i], detection.model_uncertainty[i]
        left = (1.0 - baseline.weight) * gravity
        changed[i] = observer.residual_fast[i] - baseline.weight * baseline.residual[i]
        noise = observer.noise.bandwidth * observer.noise.sigma[i]
        bias = (1.0 - baseline.weight) * _ELSEWHERE_NM
        variance = _LEAST_NM**2 + noise * noise + bias * bias + (model / _MODEL_SIGMAS) ** 2 + left * left
        sigma[i] = math.sqrt(variance + (_SCALE * changed[i]) ** 2)
        threshold = detection.threshold[i] - GRAVITY_SIGMAS * (gravity - left)
        shows = shows or abs(changed[i]) > keep * threshold
        shows = shows or abs(observer.residual_fast[i]) > keep * detection.threshold[i]
    return shows


@inlined
def _kind(touch: Record, place: Record, state: Record, pressed: float) -> tuple[int, float]:
    """Return what touches, a key of KINDS, and how probable that is. A contact of the arm comes before the tool's."""
    force = state.tool_wrench.force
    if touch.touching == 0:
        on_tool = state.arm.has_wrench != 0 and dot(force, force) >= pressed * pressed
        return (TOOL if on_tool else NO_CONTACT), 1.0
    if place.tool_probability > 0.5:
        return TOOL, place.tool_probability
    return (PUSH if state.mode == REJECT else OBSTACLE), 1.0 - place.tool_probability
