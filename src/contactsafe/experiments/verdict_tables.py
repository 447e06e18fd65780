"""The tables of a collision battery: every controller against the baseline, by plant, and the worst trials."""

from collections.abc import Mapping, Sequence

from contactsafe.experiments.verdict import FLOOR_N, REGRESSION_FRACTION, REGRESSION_N, compare
from contactsafe.results.experiment import Table, Trial
from contactsafe.results.metrics import BASELINE

WORST = 10
"""How many of the worst trials a table lists."""

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
    note = (
        "Of two obstacles the stiffer one; 1000 kN/m stands for one that cannot move. The link after the arm's last is "
        "the tool."
    )
    return Table(f"worst_{name}", title, columns, rows, note)


def _names(trials: Sequence[Trial]) -> list[str]:
    return list(dict.fromkeys(trial.controller for trial in trials))


def _baseline(names: Sequence[str]) -> str:
    return BASELINE if BASELINE in names else names[0]


def _of(trials: Sequence[Trial], controller: str, plant: str | None = None) -> list[Trial]:
    return [trial for trial in trials if trial.controller == controller and plant in (None, trial.plant)]
