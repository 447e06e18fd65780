"""The comparison of a controller with the baseline on one plant, collision by collision."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contactsafe.results.experiment import Trial
from contactsafe.results.metrics import CONTACT_N

REGRESSION_FRACTION, REGRESSION_N = 1.05, 5.0
"""A trial is a peak regression where its peak passes the baseline's by both: this multiple, and this much, N."""

SOFT_N_M = 5e3
"""Stiffest obstacle that counts as soft, N/m; of two the stiffer one is meant."""

FLOOR_N = CONTACT_N
"""Least force put into a ratio, N, above and below the line: a contact that ended does not make it zero or infinite."""


@dataclass(frozen=True)
class Verdict:
    """One controller on one plant, trial by trial against the baseline; NaN where a figure does not exist.

    Attributes:
        compared: trials in which the obstacle was touched under either of the two; all figures are of these.
        left_out: trials in which it was touched under neither.
        peak_regressions: trials whose peak passes the baseline's by `REGRESSION_FRACTION` and `REGRESSION_N`.
        peak_ratio: median of the trials' ratios of peaks, baseline to controller, each at least `FLOOR_N`.
        peak_ratio_soft: the same over obstacles of `SOFT_N_M` at most.
        peak_ratio_sweeps, peak_ratio_soft_sweeps: both over the sweeps alone, where the arm runs into something.
        steady_p95_n, steady_max_n: 95th percentile and largest of the steady force, N.
        steady_ratio: median of the trials' ratios of steady force, baseline to controller, each at least `FLOOR_N`.
        steady_ratio_sweeps: the same over the sweeps alone.
        met: fraction of the trials in which it was touched under this controller.
        reported: fraction of those in which this controller reported a contact.
        detect_median_ms, detect_p95_ms: from touch to report, of those, ms.
        switches_max: most changes between the modes.
        at_limits: fraction of the trials in which a joint came to its limit.
    """

    compared: int
    left_out: int
    peak_regressions: int
    peak_ratio: float
    peak_ratio_soft: float
    peak_ratio_sweeps: float
    peak_ratio_soft_sweeps: float
    steady_p95_n: float
    steady_max_n: float
    steady_ratio: float
    steady_ratio_sweeps: float
    met: float
    reported: float
    detect_median_ms: float
    detect_p95_ms: float
    switches_max: float
    at_limits: float


def compare(trials: Sequence[Trial], baseline: Sequence[Trial]) -> Verdict:
    """Compare the trials of one controller on one plant with the baseline's on the same plant.

    Args:
        trials: with the metrics of `collision_metrics` and `scene_metrics`.
        baseline: of the same seeds, in any order.
    """
    by_seed = {trial.seed: trial.metrics for trial in baseline}
    pairs = [(trial.metrics, by_seed[trial.seed]) for trial in trials]
    kept = [(mine, theirs) for mine, theirs in pairs if mine["met"] or theirs["met"]]

    def mine(name: str) -> np.ndarray:
        return np.array([metrics[name] for metrics, _ in kept])

    def theirs(name: str) -> np.ndarray:
        return np.array([metrics[name] for _, metrics in kept])

    peak, peak_before = mine("contact_peak_n"), theirs("contact_peak_n")
    peak_ratio = _ratio(peak_before, peak)
    steady_ratio = _ratio(theirs("contact_steady_n"), mine("contact_steady_n"))
    soft, sweeps = mine("obstacle_stiffness_n_m") <= SOFT_N_M, mine("speed_m_s") > 0
    met = mine("met") > 0
    detect = mine("detect_ms")[met]
    reported = np.isfinite(detect)
    return Verdict(
        compared=len(kept),
        left_out=len(pairs) - len(kept),
        peak_regressions=int(((peak > REGRESSION_FRACTION * peak_before) & (peak > peak_before + REGRESSION_N)).sum()),
        peak_ratio=_percentile(peak_ratio, 50),
        peak_ratio_soft=_percentile(peak_ratio[soft], 50),
        peak_ratio_sweeps=_percentile(peak_ratio[sweeps], 50),
        peak_ratio_soft_sweeps=_percentile(peak_ratio[soft & sweeps], 50),
        steady_p95_n=_percentile(mine("contact_steady_n"), 95),
        steady_max_n=_percentile(mine("contact_steady_n"), 100),
        steady_ratio=_percentile(steady_ratio, 50),
        steady_ratio_sweeps=_percentile(steady_ratio[sweeps], 50),
        met=_fraction(met),
        reported=_fraction(reported),
        detect_median_ms=_percentile(detect[reported], 50),
        detect_p95_ms=_percentile(detect[reported], 95),
        switches_max=_percentile(mine("mode_switches"), 100),
        at_limits=_fraction(mine("limit_touches") > 0),
    )


def _ratio(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    return np.maximum(above, FLOOR_N) / np.maximum(below, FLOOR_N)


def _percentile(values: np.ndarray, percent: float) -> float:
    return float(np.percentile(values, percent)) if values.size else math.nan


def _fraction(which: np.ndarray) -> float:
    return float(which.mean()) if which.size else math.nan
