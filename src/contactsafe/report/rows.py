"""Which figures are shown, what they are called, and what is aimed at."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from contactsafe.report.data import BASELINE, Experiment, Spread, number, ratio


@dataclass(frozen=True)
class Aim:
    """What a figure should be; judged on its median, or on its largest value where `worst`.

    Attributes:
        below: largest value allowed, in the row's unit.
        above: smallest value allowed, in the row's unit.
        share: largest multiple of the baseline's median allowed.
        fraction_at_least: smallest multiple of the baseline's median allowed.
        baseline_above: judge only where the baseline's median passes this, in the row's unit.
        worst: judge the largest value over seeds.
        scenarios: words of which one must stand in the scenario's name; empty for all.
    """

    below: float | None = None
    above: float | None = None
    share: float | None = None
    fraction_at_least: float | None = None
    baseline_above: float | None = None
    worst: bool = False
    scenarios: tuple[str, ...] = ()

    def text(self, unit: str) -> str:
        """Say it in a few words."""
        parts = []
        if self.above is not None and self.below is not None:
            parts.append(f"{self.above:g} to {self.below:g} {unit}")
        elif self.above is not None:
            parts.append(f"over {self.above:g} {unit}")
        elif self.below == 0:
            parts.append("always 0")
        elif self.below is not None:
            parts.append(f"{'always ' if self.worst else ''}under {self.below:g} {unit}")
        if self.share is not None:
            parts.append(f"at most {_fraction(self.share)} of {BASELINE}")
        if self.fraction_at_least is not None:
            parts.append(f"at least {_fraction(self.fraction_at_least)} of {BASELINE}")
        if self.baseline_above is not None:
            parts.append(f"where {BASELINE} passes {self.baseline_above:g}")
        return " ".join(parts)

    def judge(self, value: Spread | None, baseline: Spread | None, scale: float) -> bool | None:
        """Tell whether a figure reaches the aim; None where that cannot be said."""
        if value is None or value.n == 0:
            return None
        found = scale * (value.max if self.worst else value.median)
        of_baseline = ratio(value, baseline)
        if self.baseline_above is not None and not (baseline and scale * baseline.median > self.baseline_above):
            return None
        if (self.share is not None or self.fraction_at_least is not None) and not math.isfinite(of_baseline):
            return None
        return (
            (self.below is None or found <= self.below)
            and (self.above is None or found >= self.above)
            and (self.share is None or of_baseline <= self.share)
            and (self.fraction_at_least is None or of_baseline >= self.fraction_at_least)
        )


@dataclass(frozen=True)
class Row:
    """One figure as it is shown.

    Attributes:
        metric: its name in the trials.
        label: its name for readers.
        unit: as shown.
        scale: from the trials' unit to the one shown.
        main: also shown in the summary and in the terminal.
        aim: what it should be.
        mean: show and judge the mean over seeds in place of the median: a few boards left dirty must show.
    """

    metric: str
    label: str
    unit: str
    scale: float = 1.0
    main: bool = False
    aim: Aim | None = None
    mean: bool = False

    def aim_in(self, scenario: str) -> Aim | None:
        """Give the aim, where it applies to this scenario."""
        if self.aim is None or (self.aim.scenarios and not any(word in scenario for word in self.aim.scenarios)):
            return None
        return self.aim


@dataclass(frozen=True)
class Line:
    """A row filled in for one scenario: spreads by controller."""

    scenario: str
    row: Row
    values: Mapping[str, Spread]

    @property
    def baseline(self) -> Spread | None:
        """The baseline's figure."""
        return self.values.get(BASELINE)

    def verdict(self, controller: str) -> bool | None:
        """Tell whether a controller reaches the aim; None where there is none, or nothing to judge."""
        aim = self.row.aim_in(self.scenario)
        return None if aim is None else aim.judge(self.values.get(controller), self.baseline, self.row.scale)


TITLES = {
    "task-safety": "Task safety",
    "joint-safety": "Joint safety",
    "disturbance": "Disturbance",
    "collisions": "Collisions",
    "detection": "Detection",
    "hostile": "Hostile policy",
    "clock": "Clocks",
}

_PUSHED = Aim(below=10.0, baseline_above=25.0, share=1 / 3)

CATALOGUE: dict[str, tuple[Row, ...]] = {
    "task-safety": (
        Row(
            "ink_removed", "ink removed, mean", "%", 100.0, main=True,
            aim=Aim(above=80.0, fraction_at_least=0.95), mean=True,
        ),
        Row("clean", "boards wiped clean, mean", "%", 100.0, main=True, mean=True),
        Row("time_s", "time to a clean board", "s"),
        Row("tool_force_peak_n", "tool force, peak", "N", main=True, aim=Aim(below=40.0, worst=True)),
        Row("tool_force_median_n", "tool force, median in contact", "N", main=True, aim=Aim(below=10.0, above=2.0)),
        Row("tool_force_p95_n", "tool force, 95th percentile in contact", "N"),
        Row("landing_peak_n", "tool force, peak on landing", "N", aim=Aim(below=20.0)),
        Row("stiffness_z_free", "stiffness towards the board, z, in the air", "1/s²"),
        Row("stiffness_z_contact", "stiffness towards the board, z, in contact", "1/s²"),
        Row("damping_z_free", "damping towards the board, z, in the air", "1/s"),
        Row("damping_z_contact", "damping towards the board, z, in contact", "1/s"),
    ),
    "joint-safety": (
        Row("contact_steady_n", "contact force, steady", "N", main=True, aim=Aim(share=1 / 3)),
        Row("contact_peak_n", "contact force, peak", "N", main=True, aim=Aim(share=1 / 2)),
        Row("impulse_ns", "impulse of the contact", "N s"),
        Row(
            "tau_steady_nm", "external joint torque, steady", "N m", main=True,
            aim=Aim(below=5.0, baseline_above=8.0),
        ),
        Row("tau_peak_nm", "external joint torque, peak", "N m"),
        Row("residual_steady_nm", "residual compensated by this controller, steady", "N m"),
        Row("residual_peak_nm", "residual compensated by this controller, peak", "N m"),
        Row("detect_ms", "contact to its detection", "ms"),
        Row("met", "runs that met the obstacle", "%", 100.0),
    ),
    "disturbance": (
        Row("error_max_mm", "tool error, largest axis", "mm", main=True, aim=_PUSHED),
        Row("error_x_mm", "tool error, x", "mm"),
        Row("error_y_mm", "tool error, y", "mm"),
        Row("error_z_mm", "tool error, z", "mm"),
        Row("error_end_mm", "tool error at the end of the push", "mm"),
        Row("error_after_mm", "tool error after the push", "mm"),
    ),
    "collisions": (
        Row("contact_peak_n", "contact force, peak", "N", main=True),
        Row("contact_steady_n", "contact force, steady", "N", main=True),
        Row("impulse_ns", "impulse of the contact", "N s"),
        Row("tau_peak_nm", "external joint torque, peak", "N m"),
        Row("tau_steady_nm", "external joint torque, steady", "N m"),
        Row("detect_ms", "contact to its detection", "ms"),
        Row("tool_error_mm", "tool away from its free motion, most", "mm"),
        Row("tool_error_end_mm", "tool away from its free motion, at the end", "mm"),
        Row("tool_force_peak_n", "tool force, peak", "N"),
        Row("comply_fraction", "time spent yielding", "%", 100.0),
        Row("reject_fraction", "time in mode REJECT", "%", 100.0),
        Row("mode_switches", "changes of mode", ""),
        Row("limit_touches", "touches of joint limits", ""),
        Row("met", "trials in which the obstacle was touched, mean", "%", 100.0, mean=True),
    ),
    "detection": (
        Row("within_15_ms", "reported within 15 ms, mean", "%", 100.0, main=True, aim=Aim(above=95.0), mean=True),
        Row("within_30_ms", "reported within 30 ms, mean", "%", 100.0, main=True, aim=Aim(above=99.0), mean=True),
        Row("detect_ms", "onset to report", "ms", main=True),
        Row("link_right", "link named rightly, mean", "%", 100.0, main=True, aim=Aim(above=95.0), mean=True),
        Row("own_torque_nm", "true torque on the link's own joint", "N m"),
        Row("force_n", "force of the push", "N"),
        Row("reported_early", "a contact reported before the push, mean", "%", 100.0, main=True, mean=True),
        Row("false_alarms", "false alarms in a run", "", main=True, aim=Aim(below=0.0, worst=True)),
        Row("false_contact_s", "time in contact mode without a contact", "s"),
    ),
    "hostile": (
        Row("not_finite", "torques that are no number", "", main=True, aim=Aim(below=0.0, worst=True)),
        Row("torque_violations", "torques beyond the limit", "", main=True, aim=Aim(below=0.0, worst=True)),
        Row("torque_rate_violations", "steps beyond the rate limit", "", main=True, aim=Aim(below=0.0, worst=True)),
        Row("joint_range_violations", "ms outside the joint range", "", main=True, aim=Aim(below=0.0, worst=True)),
        Row("joint_range_beyond_mrad", "way outside the joint range, most", "mrad"),
        Row("energy_given_j", "energy given to the world", "J", main=True),
        Row(
            "energy_most_of_bound", "energy given, share of what the tank allows", "%", 100.0, main=True,
            aim=Aim(below=100.0, worst=True),
        ),
        Row("contact_peak_n", "contact force, peak", "N", main=True),
    ),
    "clock": (
        Row("false_contact_ms", "contact reported that is none", "ms", aim=Aim(below=0.0, worst=True)),
        Row("torque_step_nm", "torque step, largest", "N m", aim=Aim(below=1.0, worst=True)),
        Row("tool_away_mm", "tool away from the undisturbed run", "mm", aim=Aim(below=2.0, worst=True)),
        Row("tool_travel_mm", "tool's way until it rests", "mm"),
        Row("joint_speed_left_rad_s", "joint speed in the end", "rad/s"),
        Row("torque_step_back_nm", "torque step on reset, largest", "N m", aim=Aim(below=1.0, worst=True)),
        Row("contact_peak_n", "contact force, peak", "N"),
        Row("contact_peak_calm_n", "contact force undisturbed, peak", "N"),
    ),
}  # fmt: skip
"""Rows of the known experiments. Metrics not named here are in `summary.json` only."""

_UNITS = {"n": "N", "nm": "N m", "ns": "N s", "mm": "mm", "ms": "ms", "s": "s"}


@dataclass(frozen=True)
class _Centred:
    """A spread whose middle is its mean, for rows that say so."""

    median: float
    mean: float
    p5: float
    p95: float
    min: float
    max: float
    n: int

    @classmethod
    def on_mean(cls, spread: Spread) -> "_Centred":
        return cls(spread.mean, spread.mean, spread.p5, spread.p95, spread.min, spread.max, spread.n)


def lines(experiment: Experiment, main_only: bool = False) -> list[Line]:
    """Fill in all rows of an experiment for which there is a figure, scenario by scenario.

    Args:
        experiment: one of `CATALOGUE`, or any other, all of whose metrics are then shown.
        main_only: leave out what is only of interest beside the other figures.
    """
    out = []
    for scenario, by_controller in experiment.spreads().items():
        rows = CATALOGUE.get(experiment.name) or _rows_of_unknown(by_controller)
        for row in rows:
            values = {name: metrics[row.metric] for name, metrics in by_controller.items() if row.metric in metrics}
            if row.mean:
                values = {name: _Centred.on_mean(spread) for name, spread in values.items()}
            if values and (row.main or not main_only):
                out.append(Line(scenario, row, values))
    return out


def groups(experiment: Experiment, main_only: bool = False) -> list[tuple[str, list[tuple[str, Line]]]]:
    """Arrange `lines` for a table: headings, and under each the labelled lines.

    Scenarios head the figures; where every scenario has but one and the same figure, that figure heads the scenarios.
    """
    found = lines(experiment, main_only)
    scenarios = list(dict.fromkeys(line.scenario for line in found))
    if len(scenarios) == len(found) > 1 and len({line.row for line in found}) == 1:
        return [(found[0].row.label, [(line.scenario, line) for line in found])]
    return [(name, [(line.row.label, line) for line in found if line.scenario == name]) for name in scenarios]


def _rows_of_unknown(by_controller: Mapping[str, Mapping[str, Spread]]) -> list[Row]:
    names = dict.fromkeys(name for metrics in by_controller.values() for name in metrics)
    rows = []
    for name in names:
        stem, _, unit = name.rpartition("_")
        known = unit in _UNITS and bool(stem)
        rows.append(Row(name, (stem if known else name).replace("_", " "), _UNITS[unit] if known else "", main=True))
    return rows


def shortfalls(experiment: Experiment, controller: str) -> list[str]:
    """Say in sentences which aims a controller misses, with the figures."""
    out = []
    for line in lines(experiment):
        aim = line.row.aim_in(line.scenario)
        if aim is None or line.verdict(controller) is not False:
            continue
        value, unit = line.values[controller], line.row.unit
        found = line.row.scale * (value.max if aim.worst else value.median)
        sentence = f"{line.scenario}: {line.row.label} is {number(found)} {unit}"
        share = ratio(value, line.baseline)
        if line.baseline is not None and not aim.worst and math.isfinite(share):
            sentence += f", {number(share)} of the {number(line.row.scale * line.baseline.median)} {unit} of {BASELINE}"
        out.append(f"{sentence}; the aim is {aim.text(unit)}.")
    return out


def _fraction(value: float) -> str:
    for below in range(1, 10):
        if abs(value * below - round(value * below)) < 1e-9:
            return f"{round(value * below)}/{below}" if below > 1 else f"{round(value)}"
    return f"{value:g}"
