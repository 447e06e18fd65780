"""The tables of a battery of pushes: every controller against the baseline, by link and by ramp, and the worst."""

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from contactsafe.experiments.push_metrics import FLOOR_MM, WORSE_FRACTION, WORSE_MM
from contactsafe.results.experiment import Table, Trial

WORST = 10
"""How many of the worst trials a table lists."""

AWAY_MM = 10.0
"""A tool that is displaced by more after 2 s without a push has not come back, mm."""

RAMPS_MS = (20.0, 50.0, 150.0, 400.0, 1000.1)
"""Bounds of the classes by ramp."""

_NOTE = (
    f"Worse: displaced more than {WORSE_MM:g} mm and more than {100 * (WORSE_FRACTION - 1):.0f} % further than under "
    "{baseline} in the same trial. Ratios are taken trial by trial; displacements below "
    f"{FLOOR_MM:g} mm count as {FLOOR_MM:g} mm in them. Displaced: from where the tool is at that time in the same run "
    "without the push; across its path, without what is late or early along it. Aims: worse in 0; with a wrench median "
    "ratio at most 0.3 and 95 % of displacements under 8 mm; without one median ratio at most 0.5."
)

_Figure = Callable[[Sequence[Trial]], float]


def _percentile(name: str, percent: float) -> _Figure:
    def figure(trials: Sequence[Trial]) -> float:
        values = np.array([trial.metrics[name] for trial in trials])
        values = values[np.isfinite(values)]
        return float(np.percentile(values, percent)) if values.size else math.nan

    return figure


def _count(name: str, above: float = 0.0) -> _Figure:
    return lambda trials: int(sum(trial.metrics[name] > above for trial in trials))


def _where(moves: float, figure: _Figure) -> _Figure:
    return lambda trials: figure([trial for trial in trials if trial.metrics["moves"] == moves])


_ROWS: tuple[tuple[str, str, _Figure], ...] = (
    ("trials", "", len),
    ("worse than {baseline}", "", _count("worse")),
    ("of those the tool held", "", _where(0.0, _count("worse"))),
    ("displacement, median", "mm", _percentile("tool_displacement_mm", 50)),
    ("displacement, 95th percentile", "mm", _percentile("tool_displacement_mm", 95)),
    ("displacement, largest", "mm", _percentile("tool_displacement_mm", 100)),
    ("controller / {baseline}, median", "", _percentile("displacement_ratio", 50)),
    ("the same, the tool holds", "", _where(0.0, _percentile("displacement_ratio", 50))),
    ("the same, the tool moves", "", _where(1.0, _percentile("displacement_ratio", 50))),
    ("across its path, median", "mm", _percentile("tool_off_path_mm", 50)),
    ("across its path, 95th percentile", "mm", _percentile("tool_off_path_mm", 95)),
    ("after release, 95th percentile", "mm", _percentile("tool_displacement_after_mm", 95)),
    ("2 s after release, 95th percentile", "mm", _percentile("tool_error_end_mm", 95)),
    ("2 s after release, largest", "mm", _percentile("tool_error_end_mm", 100)),
    (f"more than {AWAY_MM:g} mm away by then", "", _count("tool_error_end_mm", AWAY_MM)),
    ("joint speed, peak, 95th percentile", "rad/s", _percentile("joint_speed_peak_rad_s", 95)),
    ("onset to report, median", "ms", _percentile("report_ms", 50)),
    ("onset to 'push', median", "ms", _percentile("reject_ms", 50)),
    ("never named a push", "", _count("never_rejected")),
    ("reported before the onset", "", _count("reported_early")),
)


def push_tables(trials: Sequence[Trial], baseline: str, replay: str) -> tuple[Table, ...]:
    """Compare every controller with the baseline, and list where and when it does worst.

    Args:
        trials: with the metrics of `push_metrics` and `against`.
        baseline: name of the controller that the others are compared with.
        replay: what runs one of them again, with {seed} for its seed.
    """
    names = list(dict.fromkeys(trial.controller for trial in trials))
    scenarios = list(dict.fromkeys(trial.scenario for trial in trials))
    columns = {
        f"{name}, {scenario}": [t for t in trials if (t.controller, t.scenario) == (name, scenario)]
        for scenario in scenarios
        for name in names
    }
    rows: tuple[tuple[str | float, ...], ...] = tuple(
        (label.format(baseline=baseline), unit, *(figure(of) for of in columns.values()))
        for label, unit, figure in _ROWS
    )
    title = f"Every controller against {baseline}, trial by trial"
    verdict = Table("verdict", title, ("figure", "unit", *columns), rows, _NOTE.format(baseline=baseline))
    worst = [_worst(name, of, baseline, replay) for name, of in columns.items() if _count("worse")(of)]
    return (verdict, _classes(columns), *worst)


def _within(name: str, low: float, high: float) -> Callable[[Trial], bool]:
    """Return what tells whether a figure of a trial is from low on and below high."""
    return lambda trial: low <= trial.metrics[name] < high


def _classes(columns: dict[str, list[Trial]]) -> Table:
    """Show median and 95th percentile of the displacement by link, ramp, direction and motion."""
    links = sorted({trial.metrics["link"] for trial in next(iter(columns.values()))})
    kinds = {f"link {link:.0f}": _within("link", link, link + 1) for link in links}
    kinds |= {
        f"ramp {low:.0f} to {high:.0f} ms": _within("ramp_ms", low, high) for low, high in itertools.pairwise(RAMPS_MS)
    }
    kinds |= {
        "along the normal": _within("angle_deg", 0.0, 1e-6),
        "oblique": _within("angle_deg", 1e-6, 89.9),
        "sideways": _within("angle_deg", 89.9, 91.0),
        "tool holds": _within("moves", 0.0, 1.0),
        "tool moves": _within("moves", 1.0, 2.0),
    }
    rows: list[tuple[str | float, ...]] = []
    for label, belongs in kinds.items():
        of = [list(filter(belongs, trials)) for trials in columns.values()]
        rows.append((label, len(of[0]), *map(_in_words, of)))
    title = "Displacement of the tool by kind of push: median, 95th percentile (mm), and trials worse"
    return Table("kinds", title, ("push", "trials", *columns), tuple(rows))


def _in_words(trials: Sequence[Trial]) -> str:
    if not trials:
        return "-"
    middle, high = (_percentile("tool_displacement_mm", percent)(trials) for percent in (50, 95))
    return f"{middle:.1f}  {high:.1f}  {_count('worse')(trials)}"


def _worst(name: str, trials: Sequence[Trial], baseline: str, replay: str) -> Table:
    ranked = sorted(trials, key=lambda t: -t.metrics["tool_displacement_mm"] * t.metrics["worse"])
    rows: tuple[tuple[str | float, ...], ...] = tuple(
        (
            trial.seed,
            "moves" if trial.metrics["moves"] else "holds",
            *(trial.metrics[key] for key in ("link", "force_n", "ramp_ms", "angle_deg", "stiffness_1_s2")),
            trial.metrics["tool_displacement_mm"],
            trial.metrics["baseline_mm"],
            replay.format(seed=trial.seed),
        )
        for trial in ranked[:WORST]
        if trial.metrics["worse"]
    )
    columns = ("seed", "tool", "link", "N", "ramp (ms)", "angle (deg)", "K1 (1/s²)", "mm", f"mm, {baseline}", "replay")
    return Table(f"worst_{name}", f"Worse than {baseline}: {name}", columns, rows)
