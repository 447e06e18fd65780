"""Small questions to ask of experiments, and how figures are written."""

import itertools
import math
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypedDict

import numpy as np

from contactsafe.results.experiment import Experiment
from contactsafe.results.recording import Recording

MISSING = "–"

COLOURS = {"vices": ("#c4480a", "#f58549"), "paper": ("#9c5b86", "#d99cc2"), "safe": ("#0067a3", "#5ab4ea")}
"""Of the known controllers, in order, on light and dark ground: vermilion, purple, blue; colour-blind readers tell them
apart too."""

_SPARE = (("#00805d", "#3cc79f"), ("#7a6a00", "#e0cf4a"), ("#555555", "#b0b0b0"))


class RunInfo(TypedDict, total=False):
    """What is known of the run beside its figures; every entry may be left out, others are passed on to the summary.

    Attributes:
        version: of contactsafe.
        when: ISO 8601 date and time.
        seeds: tried by each controller.
        bundle_sha256: digest of the policy bundle.
        command: as typed.
    """

    version: str
    when: str
    seeds: Sequence[int]
    bundle_sha256: str
    command: str


class Words(NamedTuple):
    """What a page says of itself where it is no comparison of controllers.

    Attributes:
        title, headline, introduction: at its top.
        method: where its numbers come from.
    """

    title: str
    headline: str
    introduction: str
    method: str


def controllers(experiments: Iterable[Experiment]) -> list[str]:
    """Return the names of all controllers measured or recorded: the known ones first, baseline leading, then others."""
    experiments = list(experiments)
    found = dict.fromkeys(name for e in experiments for rows in e.spreads().values() for name in rows)
    found |= dict.fromkeys(recording.controller for e in experiments for recording in e.recordings)
    return [name for name in COLOURS if name in found] + [name for name in found if name not in COLOURS]


def colours(names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Return each controller's colour on light and on dark ground, the same everywhere."""
    spare = itertools.cycle(_SPARE)
    return {name: COLOURS.get(name) or next(spare) for name in names}


def css_variable(controller: str) -> str:
    """Return the name of the CSS variable that holds a controller's colour; film.js names it alike."""
    return "--c-" + re.sub(r"[^A-Za-z0-9]", "-", controller)


def recorded(experiment: Experiment, scenario: str) -> list[Recording]:
    """Return one recording a controller of a scenario, in the order of `controllers`."""
    first: dict[str, Recording] = {}
    for recording in experiment.recordings:
        if recording.scenario == scenario and len(recording.trace):
            first.setdefault(recording.controller, recording)
    return [first[name] for name in controllers([experiment]) if name in first]


def scenarios(experiment: Experiment) -> list[str]:
    """Return the names of the scenarios that were recorded, in order."""
    return list(dict.fromkeys(recording.scenario for recording in experiment.recordings))


def seconds(recording: Recording) -> np.ndarray:
    """Return the time of every tick since the recording's start, (T,), s."""
    time = recording.trace["time"]
    return time - time[0]


def cell(value: str | float) -> str:
    """Return a table's entry: words and counts as they are, other figures with about three digits."""
    return str(value) if isinstance(value, str | int) else number(value)


def number(value: float) -> str:
    """Return a figure with about three digits; an en dash where there is none."""
    if not math.isfinite(value):
        return MISSING
    size = abs(value)
    text = f"{value:.{0 if size >= 100 else 1 if size >= 10 else 2}f}"
    return text.replace("-", "−")
