"""The comparison of a collision battery: controllers against the baseline, by plant, and the worst trials."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from contactsafe.results.experiment import Table, Trial
from contactsafe.results.metrics import BASELINE, CONTACT_N

REGRESSION_FRACTION, REGRESSION_N = 1.05, 5.0
"""A trial is a peak regression where its peak passes the baseline's by both: this multiple, and this much, N."""

SOFT_N_M = 5e3
"""Stiffest obstacle that counts as soft, N/m; of two the stiffer one is meant."""

FLOOR_N = CONTACT_N
"""Least force put into a ratio, N, above and below the line: a contact that ended does not make it zero or infinite."""

WORST = 10


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


_ROWS = (
    ("compared", "trials compared", "", 1),
    ("left_out", "trials left out: nothing touched", "", 1),
    ("peak_regressions", "peak regressions against {baseline}", "", 1),
    ("peak_ratio", "peak force, {baseline} / controller, median", "", 1),
    ("peak_ratio_soft", "the same, obstacles of 5 kN/m at most", "", 1),
    ("peak_ratio_sweeps", "the same, sweeps alone", "", 1),
    ("peak_ratio_soft_sweeps", "the same, sweeps into 5 kN/m at most", "", 1),
    ("steady_p95_n", "steady force, 95th percentile", "N", 1),
    ("steady_max_n", "steady force, largest", "N", 1),
    ("steady_ratio", "steady force, {baseline} / controller, median", "", 1),
    ("steady_ratio_sweeps", "the same, sweeps alone", "", 1),
    ("met", "trials in which the obstacle was touched", "%", 100),
    ("reported", "of those, contact reported", "%", 100),
    ("detect_median_ms", "touch to report, median", "ms", 1),
    ("detect_p95_ms", "touch to report, 95th percentile", "ms", 1),
    ("switches_max", "changes of mode, most in a trial", "", 1),
    ("at_limits", "trials that touch a joint limit", "%", 100),
)
_NOTE = (
    "Peak regression: a peak more than {percent:.0f} % and more than {n:g} N above that of {baseline} in the same "
    "trial. Ratios are taken trial by trial; forces below {floor:g} N count as {floor:g} N in them, so that a contact "
    "that ended counts, and counts no more than that. Trials in which nothing was touched, neither under the "
    "controller nor under {baseline}, are left out. Steady: mean of the last 0.5 s. The clean plant is an arm just as "
    "the controller's model has it."
)


def verdict_table(trials: Sequence[Trial]) -> Table:
    """Compare every controller on every plant: a column each, the plants of a controller side by side."""
    names, plants = _names(trials), dict.fromkeys(trial.plant for trial in trials)
    baseline = _baseline(names)
    columns = {
        f"{name}, {plant}": compare(_of(trials, name, plant), _of(trials, baseline, plant))
        for name in names
        for plant in plants
    }
    rows: tuple[tuple[str | float, ...], ...] = tuple(
        (label.format(baseline=baseline), unit, *(scale * getattr(verdict, field) for verdict in columns.values()))
        for field, label, unit, scale in _ROWS
    )
    note = _NOTE.format(percent=100 * (REGRESSION_FRACTION - 1), n=REGRESSION_N, floor=FLOOR_N, baseline=baseline)
    title = f"Every controller against {baseline}, trial by trial"
    return Table("verdict", title, ("figure", "unit", *columns), rows, note)


def worst_tables(trials: Sequence[Trial], replay: str) -> tuple[Table, ...]:
    """List the trials whose peaks are furthest above the baseline's, of each other controller; a seed once.

    Args:
        trials: of all controllers and plants.
        replay: what runs one of them again, with {seed} for its seed.
    """
    names = _names(trials)
    baseline = _baseline(names)
    before = {(t.seed, t.plant): t.metrics["contact_peak_n"] for t in trials if t.controller == baseline}
    return tuple(_worst(name, baseline, _of(trials, name), before, replay) for name in names if name != baseline)


def _worst(
    name: str, baseline: str, trials: Sequence[Trial], before: Mapping[tuple[int, str], float], replay: str
) -> Table:
    ranked = sorted(trials, key=lambda t: before[t.seed, t.plant] - t.metrics["contact_peak_n"])
    worst: dict[int, Trial] = {}
    for trial in ranked:
        worst.setdefault(trial.seed, trial)  # on the plant where it is worse
    rows: tuple[tuple[str | float, ...], ...] = tuple(
        (
            trial.seed,
            trial.heading,
            int(trial.metrics["link"]),
            trial.metrics["obstacle_stiffness_n_m"] / 1000.0,
            trial.metrics["contact_peak_n"],
            before[trial.seed, trial.plant],
            replay.format(seed=trial.seed),
        )
        for trial in list(worst.values())[:WORST]
    )
    columns = ("seed", "scene", "link", "kN/m", f"peak (N), {name}", f"peak (N), {baseline}", "replay")
    title = f"The worst trials of {name}: peaks furthest above those of {baseline}"
    note = "Of two obstacles the stiffer one; 1000 kN/m stands for one that cannot move. Link 8 is the hand."
    return Table(f"worst_{name}", title, columns, rows, note)


def _names(trials: Sequence[Trial]) -> list[str]:
    return list(dict.fromkeys(trial.controller for trial in trials))


def _baseline(names: Sequence[str]) -> str:
    return BASELINE if BASELINE in names else names[0]


def _of(trials: Sequence[Trial], controller: str, plant: str | None = None) -> list[Trial]:
    return [trial for trial in trials if trial.controller == controller and plant in (None, trial.plant)]
