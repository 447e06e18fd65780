"""What this room reads: experiments as it sees them, and small questions to ask of them."""

import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol, TypedDict

import numpy as np

BASELINE = "vices"
"""The controller that the others are compared with."""

MISSING = "–"

COLOURS = {"vices": ("#c4480a", "#f58549"), "paper": ("#9c5b86", "#d99cc2"), "safe": ("#0067a3", "#5ab4ea")}
"""Of the known controllers, in order, on light and dark ground: vermilion, purple, blue; colour-blind readers tell them
apart too."""

_SPARE = (("#00805d", "#3cc79f"), ("#7a6a00", "#e0cf4a"), ("#555555", "#b0b0b0"))


class Spread(Protocol):
    """A figure over seeds; NaN where no trial has it."""

    @property
    def median(self) -> float: ...  # noqa: D102
    @property
    def mean(self) -> float: ...  # noqa: D102
    @property
    def p5(self) -> float: ...  # noqa: D102
    @property
    def p95(self) -> float: ...  # noqa: D102
    @property
    def min(self) -> float: ...  # noqa: D102
    @property
    def max(self) -> float: ...  # noqa: D102
    @property
    def n(self) -> int: ...  # noqa: D102


class Recording(Protocol):
    """One trial in time; `contactsafe.experiments.results.Recording` is one."""

    @property
    def scenario(self) -> str: ...  # noqa: D102
    @property
    def controller(self) -> str: ...  # noqa: D102
    @property
    def seed(self) -> int: ...  # noqa: D102
    @property
    def trace(self) -> np.ndarray: ...  # noqa: D102
    @property
    def boards(self) -> np.ndarray: ...  # noqa: D102
    @property
    def board_every(self) -> int: ...  # noqa: D102
    @property
    def obstacle(self) -> tuple[float, float] | None: ...  # noqa: D102


class Trial(Protocol):
    """One run of one controller; `contactsafe.experiments.results.Trial` is one."""

    @property
    def scenario(self) -> str: ...  # noqa: D102
    @property
    def controller(self) -> str: ...  # noqa: D102
    @property
    def seed(self) -> int: ...  # noqa: D102
    @property
    def plant(self) -> str: ...  # noqa: D102
    @property
    def metrics(self) -> Mapping[str, float]: ...  # noqa: D102


class Table(Protocol):
    """Figures that are no spreads; `contactsafe.experiments.results.Table` is one."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def title(self) -> str: ...  # noqa: D102
    @property
    def columns(self) -> Sequence[str]: ...  # noqa: D102
    @property
    def rows(self) -> Sequence[Sequence[str | float]]: ...  # noqa: D102
    @property
    def note(self) -> str: ...  # noqa: D102


class Experiment(Protocol):
    """What one experiment measured; `contactsafe.experiments.results.Experiment` is one."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def question(self) -> str: ...  # noqa: D102
    @property
    def trials(self) -> Sequence[Trial]: ...  # noqa: D102
    @property
    def recordings(self) -> Sequence[Recording]: ...  # noqa: D102
    @property
    def tables(self) -> Sequence[Table]: ...  # noqa: D102

    def spreads(self) -> Mapping[str, Mapping[str, Mapping[str, Spread]]]:
        """Scenario → controller → metric → spread over seeds."""
        ...

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        ...


class RunInfo(TypedDict, total=False):
    """What is known of the run beside its figures; every entry may be left out, others are passed on to the summary.

    Attributes:
        version: of contactsafe.
        when: ISO 8601 date and time.
        seeds: tried by each controller.
        bundle_sha256: digest of the policy bundle.
        command: as typed.
        push_s: start and end of the pushes of the disturbance experiment, s.
    """

    version: str
    when: str
    seeds: Sequence[int]
    bundle_sha256: str
    command: str
    push_s: tuple[float, float]


def find(experiments: Iterable[Experiment], name: str) -> Experiment | None:
    """Give the experiment of that name."""
    return next((experiment for experiment in experiments if experiment.name == name), None)


def controllers(experiments: Iterable[Experiment]) -> list[str]:
    """Name all controllers measured: the known ones first, baseline leading, then others as they come."""
    found = dict.fromkeys(name for e in experiments for rows in e.spreads().values() for name in rows)
    return [name for name in COLOURS if name in found] + [name for name in found if name not in COLOURS]


def colours(names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Give each controller its colour on light and on dark ground, the same everywhere."""
    spare = itertools.cycle(_SPARE)
    return {name: COLOURS.get(name) or next(spare) for name in names}


def css_variable(controller: str) -> str:
    """Name the CSS variable that holds a controller's colour; film.js names it alike."""
    return "--c-" + re.sub(r"[^A-Za-z0-9]", "-", controller)


def recorded(experiment: Experiment, scenario: str) -> list[Recording]:
    """Give one recording a controller of a scenario, in the order of `controllers`."""
    first: dict[str, Recording] = {}
    for recording in experiment.recordings:
        if recording.scenario == scenario and len(recording.trace):
            first.setdefault(recording.controller, recording)
    return [first[name] for name in controllers([experiment]) if name in first]


def scenarios(experiment: Experiment) -> list[str]:
    """Name the scenarios that were recorded, in order."""
    return list(dict.fromkeys(recording.scenario for recording in experiment.recordings))


def seconds(recording: Recording) -> np.ndarray:
    """Give the time of every tick since the recording's start, (T,), s."""
    time = recording.trace["time"]
    return time - time[0]


def ratio(value: Spread | None, baseline: Spread | None) -> float:
    """Divide two medians; NaN where one does not exist or the baseline is zero."""
    if value is None or baseline is None or not baseline.median:
        return math.nan
    return value.median / baseline.median


def cell(value: str | float) -> str:
    """Write a table's entry: words and counts as they are, other figures with about three digits."""
    return str(value) if isinstance(value, str | int) else number(value)


def number(value: float) -> str:
    """Write a figure with about three digits; an en dash where there is none."""
    if not math.isfinite(value):
        return MISSING
    size = abs(value)
    text = f"{value:.{0 if size >= 100 else 1 if size >= 10 else 2}f}"
    return text.replace("-", "−")
