"""Noise: what the detecting residual carries while nothing touches the arm, and how much it is filtered for it.

Noise of velocity between 5 and 50 Hz shows in the residual about in proportion to its bandwidth; white noise of torque
falls only with the root of it, so what is left of that is more than allowed. It is measured behind the
filters as they are configured, whatever is in force, so that one does not follow the other in circles.
"""

import math

import numpy as np

from contactsafe.control.laws import filter_gain, observer_step
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled, inlined

_f = np.float64

_SLOW_1_S = 25.0
"""What changes more slowly than 4 Hz is not noise: friction, weight, a push."""

_LEARN, _LEARN_S, _KEEP_S = 0.3, 0.03, 1.0
"""Time in which what is believed of the noise may change by a factor of e: a fraction of that for which it was
measured, and at least and at most."""

_GUESSED_S = 1.0
"""Until it was measured for so long it is rather a guess, which motion may lower as well."""

_PRIOR, _FLOOR = 4.0, 0.2
"""Of what is allowed: the noise that is believed in at first, and the least that is told from none."""

_LEAST_BANDWIDTH = 0.1

_OF_POSITIONS = 0.6
"""Most of the bandwidth for velocities from positions: one position that is read late, or was filled in, shows."""

_MEDIAN = 0.6745
"""Half of a normal distribution lies within so many standard deviations."""


def noise_dtype(n: int) -> np.dtype:
    """Describe what is known of the residual's noise."""
    return np.dtype(
        [
            ("unfiltered", _f, (n,)),  # residual at full bandwidth before its low-pass, N m
            ("residual", _f, (n,)),  # at full bandwidth, N m
            ("slow", _f, (n,)),  # the part of it below 4 Hz, N m
            ("sigma", _f, (n,)),  # standard deviation of the rest, N m
            ("seconds", _f),  # for which it was measured
            ("bandwidth", _f),  # in force, fraction of what is configured
        ]
    )


@compiled
def start_noise(noise: Record, allowed_nm: float) -> None:
    """Begin with noise that may be larger than allowed."""
    noise.seconds, noise.bandwidth = 0.0, 1.0
    if math.isfinite(allowed_nm):
        noise.bandwidth, noise.sigma[:] = 1.0 / _PRIOR, _PRIOR * allowed_nm


@inlined
def follow_noise(
    noise: Record, raw: Vector, model_uncertainty: Vector, of_positions: int, step: Record, untouched: bool,
    tool_free: bool, allowed_nm: float,
) -> None:  # fmt: skip
    """Measure the noise of the residual at full bandwidth, and set the bandwidth that keeps it to what is allowed.

    Args:
        noise: `noise_dtype` record; advanced.
        raw: external torque before any filter, (n,), N m.
        model_uncertainty: of it, (n,), N m; no noise, since the thresholds allow for it already.
        of_positions: whether any joint's velocity is a difference of positions.
        step: of the state.
        untouched: whether nothing touches the arm; else nothing is learned.
        tool_free: whether no contact of the tool is in the torque; else no more noise is learned, only less.
        allowed_nm: standard deviation, N m; inf for any.
    """
    if not math.isfinite(allowed_nm):
        return
    observer_step(noise.unfiltered, step.full_filter_gain, raw)
    observer_step(noise.residual, step.full_lowpass_gain, noise.unfiltered)
    observer_step(noise.slow, filter_gain(_SLOW_1_S, step.dt), noise.residual)
    if untouched:
        _learn(noise, model_uncertainty, tool_free, step.dt, _FLOOR * allowed_nm)
    most = _OF_POSITIONS if of_positions != 0 else 1.0
    noise.bandwidth = min(max(allowed_nm / noise.sigma.max(), _LEAST_BANDWIDTH), most)


@inlined
def _learn(noise: Record, model_uncertainty: Vector, tool_free: bool, dt: float, least_nm: float) -> None:
    """Follow the median of the noise, upwards or downwards by a fraction of itself.

    A push that begins moves it no faster than that, however hard it is.
    """
    noise.seconds += dt
    factor = math.exp(dt / min(max(_LEARN * noise.seconds, _LEARN_S), _KEEP_S))
    guessed = noise.seconds < _GUESSED_S
    for i in range(noise.sigma.shape[0]):
        seen = abs(noise.residual[i] - noise.slow[i]) - model_uncertainty[i]
        if seen > _MEDIAN * noise.sigma[i]:
            noise.sigma[i] *= factor if tool_free else 1.0
        elif guessed or model_uncertainty[i] < noise.sigma[i]:  # or motion hides the noise, and would have it forgotten
            noise.sigma[i] = max(noise.sigma[i] / factor, least_nm)


@inlined
def noise_left(noise: Record, i: int, allowed_nm: float) -> float:
    """Return by how much joint i's noise exceeds what is allowed with the bandwidth in force, N m."""
    if not math.isfinite(allowed_nm):
        return 0.0
    return max(noise.bandwidth * noise.sigma[i] - allowed_nm, 0.0)
