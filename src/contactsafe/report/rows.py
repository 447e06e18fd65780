"""The declared metrics filled in: one line a scenario and metric, compared with its aims."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from contactsafe.report.data import number
from contactsafe.results.experiment import Experiment
from contactsafe.results.metrics import BASELINE, Metric, ratio
from contactsafe.results.spread import Spread


@dataclass(frozen=True)
class Line:
    """A metric filled in for one scenario: spreads by controller."""

    scenario: str
    metric: Metric
    values: Mapping[str, Spread]

    @property
    def baseline(self) -> Spread | None:
        """The baseline's figure."""
        return self.values.get(BASELINE)

    def reaches(self, controller: str) -> bool | None:
        """Return whether a controller reaches the aim; None where there is none, or nothing to compare."""
        aim = self.metric.aim
        return None if aim is None else aim.is_reached(self.values.get(controller), self.baseline, self.metric.scale)


def lines(experiment: Experiment, main_only: bool = False) -> list[Line]:
    """Return all declared metrics for which there is a figure, scenario by scenario.

    Args:
        experiment: whose.
        main_only: leave out what is only of interest beside the other figures.
    """
    out = []
    for scenario, by_controller in experiment.spreads().items():
        for metric in experiment.metrics:
            values = {name: row[metric.name] for name, row in by_controller.items() if metric.name in row}
            if metric.mean:
                values = {name: spread.centred_on_mean() for name, spread in values.items()}
            if values and (metric.main or not main_only):
                out.append(Line(scenario, metric, values))
    return out


def groups(experiment: Experiment, main_only: bool = False) -> list[tuple[str, list[tuple[str, Line]]]]:
    """Arrange `lines` for a table: headings, and under each the labelled lines.

    Scenarios head the figures; where every scenario has but one and the same figure, that figure heads the scenarios.
    """
    found = lines(experiment, main_only)
    scenarios = list(dict.fromkeys(line.scenario for line in found))
    if len(scenarios) == len(found) > 1 and len({line.metric.name for line in found}) == 1:
        return [(found[0].metric.label, [(line.scenario, line) for line in found])]
    return [(name, [(line.metric.label, line) for line in found if line.scenario == name]) for name in scenarios]


def highlights(experiments: Sequence[Experiment]) -> list[tuple[str, Line]]:
    """Return the highlights of experiments, each labelled; those without a figure are left out."""
    out = []
    for experiment in experiments:
        found = {(line.scenario, line.metric.name): line for line in lines(experiment)}
        for highlight in experiment.highlights:
            if (highlight.scenario, highlight.metric) in found:
                out.append((highlight.label, found[highlight.scenario, highlight.metric]))
    return out


def shortfalls(experiment: Experiment, controller: str) -> list[str]:
    """Return, in sentences, which aims a controller misses, with the figures."""
    out = []
    for line in lines(experiment):
        aim = line.metric.aim
        if aim is None or line.reaches(controller) is not False:
            continue
        value, unit, scale = line.values[controller], line.metric.unit, line.metric.scale
        sentence = f"{line.scenario}: {line.metric.label} is {number(scale * aim.compared(value))} {unit}"
        multiple = ratio(value, line.baseline)
        if line.baseline is not None and not aim.always and math.isfinite(multiple):
            sentence += f", {number(multiple)} of the {number(scale * line.baseline.middle)} {unit} of {BASELINE}"
        out.append(f"{sentence}; the aim is {aim.text(unit)}.")
    return out
