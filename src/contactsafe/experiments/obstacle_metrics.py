"""What the arm's contact with an obstacle comes to: peak, steady part, impulse, joint torque, delay of detection."""

import math

import numpy as np

from contactsafe.results.metrics import CONTACT_N


def obstacle_metrics(
    trace: np.ndarray, steady_s: float, *, of_met_only: bool, reported_before_ms: float
) -> dict[str, float]:
    """Summarise the contact of one run by the simulator's truth.

    Args:
        trace: `trace_dtype` records, (T,).
        steady_s: length of the last part, over which steady figures are means, s.
        of_met_only: all but `met` are NaN where nothing was met; else they are those of a run without contact, and the
            delay alone is NaN.
        reported_before_ms: delay where a contact was reported already when the obstacle was met: 0 counts it as
            detected at once, NaN as a report of something else.
    """
    force, last = trace["obstacle_force"], last_part(trace, steady_s)
    touching, tau = force > CONTACT_N, np.abs(trace["tau_arm"]).max(axis=1)
    found = {
        "contact_peak_n": float(force.max()),
        "contact_steady_n": float(force[last].mean()),
        "impulse_ns": float(force.sum() / 1000.0),
        "tau_peak_nm": float(tau.max()),
        "tau_steady_nm": float(tau[last].mean()),
        "detect_ms": _delay_ms(touching, trace["link"] > 0, reported_before_ms),
    }
    if of_met_only and not touching.any():
        found = dict.fromkeys(found, math.nan)
    return {"met": float(touching.any()), **found}


def last_part(trace: np.ndarray, seconds: float) -> np.ndarray:
    """Return which ticks are within so many seconds of the end, (T,)."""
    return trace["time"] > trace["time"][-1] - seconds


def _delay_ms(touching: np.ndarray, reported: np.ndarray, reported_before_ms: float) -> float:
    """Return the ticks from the first touch to the first report from then on; NaN without either."""
    later = reported[int(np.argmax(touching)) :]
    if not (touching.any() and later.any()):
        return math.nan
    return reported_before_ms if later[0] else float(np.argmax(later))
