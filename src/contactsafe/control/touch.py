"""Touch: whether anything touches the arm or its tool, which of the two, and where, whatever the laws make of it."""

import math

import numpy as np

from contactsafe.control.baseline import follow_baseline
from contactsafe.control.codes import FREE, NO_CONTACT, OBSTACLE, PUSH, REJECT, TOOL
from contactsafe.control.detection import GRAVITY_SIGMAS
from contactsafe.control.evidence import Uncertainty, moment_variance
from contactsafe.control.localisation import forget_place, localise
from contactsafe.core.arrays import Record
from contactsafe.core.compiled import inlined
from contactsafe.core.linalg import dot

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


def touch_dtype(n: int) -> np.dtype:
    """Describe what is remembered of whatever touches."""
    return np.dtype(
        [
            ("touching", _i),
            ("withholds", _i),  # nothing is learnt meanwhile: of an estimator; in a controller the mode decides that
            ("ticks", _i),  # since it began or ended
            ("quiet_ticks", _i),  # since the residual was above what keeps a contact
            ("kind", _i),  # key of KINDS
            ("torque", _f, (n,)),  # fast residual less its baseline, N m
            ("sigma", _f, (n,)),  # its standard deviation, N m
        ]
    )


@inlined
def follow_touch(c: Record) -> None:
    """Tell whether anything touches, and if so where.

    Args:
        c: `controller_dtype` record, its thresholds, mode and tool force up to date.
    """
    state, params = c.state, c.params
    touch, place = state.touch, state.localisation
    shows = _shows(c)
    ticks = max(round(state.step.ticks), 1)
    touch.ticks += ticks
    touch.quiet_ticks = 0 if shows else touch.quiet_ticks + ticks
    began = touch.touching == 0 and shows
    quiet = touch.quiet_ticks * params.clock.dt > _QUIET_S
    ended = touch.touching != 0 and touch.ticks >= params.detection.dwell_ticks and quiet
    if began or ended:
        touch.touching, touch.ticks = 1 if began else 0, 0
        forget_place(place)
    if touch.touching != 0 and c.handle.place_points > c.handle.tool_places:
        known = Uncertainty(touch.sigma, moment_variance(touch.torque))
        localise(
            place, c.handle, touch.torque, known, state.arm.q, state.baseline.weight,
            _tool_prior(state, params.observer), state.step.dt,
        )  # fmt: skip
    touch.kind = _kind(touch, place, state, params.classification.tool_contact_n)


@inlined
def _tool_prior(state: Record, params: Record) -> float:
    """Return how probable the tool is before the torques are asked."""
    tells = state.arm.has_wrench != 0 or state.arm.q.shape[0] > 6  # as `separate_tool_wrench` does
    if state.mode != FREE and tells:
        return _NEVER_TOOL
    return _TOOL_PRIOR_SEEN if state.arm.has_wrench != 0 and params.cancel_tool_wrench != 0 else _TOOL_PRIOR


@inlined
def follow_change(c: Record) -> None:
    """Learn the residual's baseline while nothing touches; set what it shows beyond that, and how well that is known.

    Args:
        c: `controller_dtype` record, its model uncertainty and noise up to date.
    """
    state = c.state
    observer, detection, touch, baseline = state.observer, state.detection, state.touch, state.baseline
    untouched = touch.withholds == 0 and state.mode == FREE
    follow_baseline(baseline, observer.residual_fast, state.arm.q, untouched, state.step.dt)
    for i in range(touch.torque.shape[0]):
        changed = observer.residual_fast[i] - baseline.weight * baseline.residual[i]
        left = (1.0 - baseline.weight) * state.link_masses.gravity_sigma[i]
        noise = observer.noise.bandwidth * observer.noise.sigma[i]
        bias = (1.0 - baseline.weight) * _ELSEWHERE_NM
        model = detection.model_uncertainty[i] / _MODEL_SIGMAS
        variance = _LEAST_NM**2 + noise * noise + bias * bias + model * model + left * left
        touch.torque[i], touch.sigma[i] = changed, math.sqrt(variance + (_SCALE * changed) ** 2)


@inlined
def _shows(c: Record) -> bool:
    """Tell whether the residual or its change shows a touch: above the threshold, or what keeps one."""
    state = c.state
    observer, detection, touch = state.observer, state.detection, state.touch
    keep = c.params.detection.release_fraction if touch.touching != 0 else 1.0
    shows = False
    for i in range(touch.torque.shape[0]):
        known = state.baseline.weight * state.link_masses.gravity_sigma[i]  # is in the baseline
        threshold = detection.threshold[i] - GRAVITY_SIGMAS * known
        shows = shows or abs(touch.torque[i]) > keep * threshold
        shows = shows or abs(observer.residual_fast[i]) > keep * detection.threshold[i]
    return shows


@inlined
def _kind(touch: Record, place: Record, state: Record, pressed: float) -> int:
    """Return what touches, a key of KINDS. A contact of the arm comes before the tool's."""
    force = state.tool_wrench.force
    if touch.touching == 0:
        on_tool = state.arm.has_wrench != 0 and dot(force, force) >= pressed * pressed
        return TOOL if on_tool else NO_CONTACT
    if place.tool_probability > 0.5:
        return TOOL
    return PUSH if state.mode == REJECT else OBSTACLE
