"""Metrics, declared once where they are computed: name, label, unit, and what is aimed at."""

import math
from dataclasses import dataclass
from typing import Any

from contactsafe.results.spread import Spread

CONTACT_N = 0.5
"""Force above which a tick, or a policy step by its largest, counts as contact, N."""

BASELINE = "vices"
"""The controller that the others are compared with."""


@dataclass(frozen=True)
class Aim:
    """What a metric should be, compared with its middle over seeds, or with its largest value where `always`.

    Attributes:
        at_most: largest value allowed, in the metric's shown unit.
        at_least: smallest value allowed, in the shown unit.
        ratio_at_most: largest multiple of the baseline's middle allowed.
        ratio_at_least: smallest multiple of the baseline's middle allowed.
        where_baseline_above: compare only where the baseline's middle passes this, in the shown unit.
        always: compare the largest value over seeds.
    """

    at_most: float | None = None
    at_least: float | None = None
    ratio_at_most: float | None = None
    ratio_at_least: float | None = None
    where_baseline_above: float | None = None
    always: bool = False

    def text(self, unit: str) -> str:
        """Return the aim in a few words."""
        parts = [self._bounds(unit)]
        if self.ratio_at_most is not None:
            parts.append(f"at most {_fraction(self.ratio_at_most)} of {BASELINE}")
        if self.ratio_at_least is not None:
            parts.append(f"at least {_fraction(self.ratio_at_least)} of {BASELINE}")
        if self.where_baseline_above is not None:
            parts.append(f"where {BASELINE} passes {self.where_baseline_above:g}")
        return " ".join(part for part in parts if part)

    def _bounds(self, unit: str) -> str:
        if self.at_most == 0:
            return "always 0"
        if self.at_least is not None and self.at_most is not None:
            return f"{self.at_least:g} to {self.at_most:g} {unit}"
        if self.at_least is not None:
            return f"over {self.at_least:g} {unit}"
        return "" if self.at_most is None else f"{'always ' if self.always else ''}under {self.at_most:g} {unit}"

    def is_reached(self, value: Spread | None, baseline: Spread | None, scale: float) -> bool | None:
        """Return whether a metric reaches the aim; None where that cannot be said.

        Args:
            value: of the controller in question.
            baseline: of the baseline.
            scale: from the spreads' unit to the shown one.
        """
        if value is None or value.n == 0:
            return None
        found, multiple = scale * self.compared(value), ratio(value, baseline)
        reference = math.nan if baseline is None else scale * baseline.middle
        if self.where_baseline_above is not None and not reference > self.where_baseline_above:
            return None
        if (self.ratio_at_most is not None or self.ratio_at_least is not None) and not math.isfinite(multiple):
            return None
        return (
            (self.at_most is None or found <= self.at_most)
            and (self.at_least is None or found >= self.at_least)
            and (self.ratio_at_most is None or multiple <= self.ratio_at_most)
            and (self.ratio_at_least is None or multiple >= self.ratio_at_least)
        )

    def compared(self, value: Spread) -> float:
        """Return the value of a spread that the aim is compared with."""
        return value.max if self.always else value.middle


ZERO = Aim(at_most=0.0, always=True)
"""Not once."""


@dataclass(frozen=True)
class Metric:
    """One figure of a trial, as it is shown.

    Attributes:
        name: its key in `Trial.metrics`; ends in the unit.
        label: its name for readers.
        unit: as shown.
        scale: from the trials' unit to the one shown.
        main: also shown in the summary and in the terminal.
        aim: what it should be.
        mean: its middle over seeds is the mean in place of the median: a few failures must show.
    """

    name: str
    label: str
    unit: str = ""
    scale: float = 1.0
    main: bool = False
    aim: Aim | None = None
    mean: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Return the declaration as plain values for JSON."""
        return {
            "label": self.label,
            "unit": self.unit,
            "scale": self.scale,
            "middle": "mean" if self.mean else "median",
            "aim": self.aim.text(self.unit) if self.aim else "",
        }


@dataclass(frozen=True)
class Highlight:
    """A metric of one scenario that stands for its experiment: a card of the page, a row of the README.

    Attributes:
        scenario: a heading of the experiment.
        metric: name of one of its metrics.
        label: what it is, for who reads nothing else.
    """

    scenario: str
    metric: str
    label: str


def ratio(value: Spread | None, baseline: Spread | None) -> float:
    """Return the ratio of two middles; NaN where one does not exist or the baseline is zero."""
    if value is None or baseline is None or not baseline.middle:
        return math.nan
    return value.middle / baseline.middle


def _fraction(value: float) -> str:
    for below in range(1, 10):
        if abs(value * below - round(value * below)) < 1e-9:
            return f"{round(value * below)}/{below}" if below > 1 else f"{round(value)}"
    return f"{value:g}"
