"""Everything one experiment measured, with the declaration of what it is."""

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from contactsafe.results.figures import Figure
from contactsafe.results.metrics import Highlight, Metric
from contactsafe.results.recording import Portrait, Recording, Stage
from contactsafe.results.spread import Spread, spread


@dataclass(frozen=True)
class Trial:
    """One run of one controller.

    Attributes:
        scenario: what was done, such as 'bottle'.
        controller: preset by name.
        seed: of scene, start, obstacle and noise.
        metrics: figures by name; the name ends in the unit.
        plant: what it was done with where there is a choice, 'real' or 'clean'; else empty.
    """

    scenario: str
    controller: str
    seed: int
    metrics: dict[str, float]
    plant: str = ""

    @property
    def heading(self) -> str:
        """Under what its figures are gathered: the scenario, and the plant where there is a choice."""
        return f"{self.scenario}, {self.plant} plant" if self.plant else self.scenario


@dataclass(frozen=True)
class Table:
    """Figures that are no spreads over seeds.

    Attributes:
        name: in JSON.
        title: for readers.
        columns: their heads.
        rows: words and numbers, one each column; NaN where a figure does not exist.
        note: how to read it, in a sentence or two.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | float, ...], ...]
    note: str = ""

    def as_records(self) -> list[dict[str, Any]]:
        """Return each row as a dictionary by column."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]


@dataclass(frozen=True)
class Experiment:
    """Everything one experiment measured.

    Attributes:
        name: as on the command line, such as 'joint-safety'.
        title: for readers.
        question: what it asks, in a sentence.
        trials: all of them.
        metrics: which of the trials' figures are shown, in order; the others are in `summary.json` and CSV alone.
        highlights: which of them stand for the experiment.
        recordings: of one seed, one for each scenario and controller that is to be shown.
        figures: which of their curves are plotted.
        stage: on which they are filmed; None for no film.
        tables: what else there is to say.
        portraits: of arms, where it has several.
        policy: what the learned policy does, in a sentence; empty where none acts.
    """

    name: str
    title: str
    question: str
    trials: tuple[Trial, ...] = ()
    metrics: tuple[Metric, ...] = ()
    highlights: tuple[Highlight, ...] = ()
    recordings: tuple[Recording, ...] = ()
    figures: tuple[Figure, ...] = ()
    stage: Stage | None = None
    tables: tuple[Table, ...] = ()
    portraits: tuple[Portrait, ...] = ()
    policy: str = ""

    def spreads(self) -> dict[str, dict[str, dict[str, Spread]]]:
        """Return the trials gathered: heading → controller → metric → spread over seeds."""
        values: dict[str, dict[str, dict[str, list[float]]]] = {}
        for trial in self.trials:
            row = values.setdefault(trial.heading, {}).setdefault(trial.controller, {})
            for name, value in trial.metrics.items():
                row.setdefault(name, []).append(value)
        return {
            scenario: {
                controller: {name: spread(numbers) for name, numbers in row.items()} for controller, row in rows.items()
            }
            for scenario, rows in values.items()
        }

    def as_dict(self) -> dict[str, Any]:
        """Return declaration, tables, spreads and trials as plain values for JSON; what does not exist is null."""
        spreads = {
            scenario: {
                controller: {name: _plain(value.as_dict()) for name, value in row.items()}
                for controller, row in rows.items()
            }
            for scenario, rows in self.spreads().items()
        }
        return {
            "title": self.title,
            "question": self.question,
            "metrics": {metric.name: metric.as_dict() for metric in self.metrics},
            "highlights": [asdict(highlight) for highlight in self.highlights],
            "tables": {table.name: _plain(table.as_records()) for table in self.tables},
            "spread": spreads,
            "trials": [_plain(asdict(trial)) for trial in self.trials],
        }


def _plain(value: Any) -> Any:
    """Return a value fit for strict JSON: NaN becomes null, floats keep six significant digits."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value


def to_json(value: Any) -> str:
    """Return strict JSON, indented; a figure that does not exist (NaN) is null."""
    return json.dumps(_plain(value), indent=1, allow_nan=False)
