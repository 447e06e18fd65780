"""What an experiment gives back: trials with figures, their spread over seeds, and recordings to be drawn."""

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Trial:
    """One run of one controller.

    Attributes:
        scenario: what was done, such as 'bottle' or 'push on link 5 while wiping'.
        controller: preset by name.
        seed: of board, start, obstacle and noise.
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
class Spread:
    """A figure over seeds.

    Attributes:
        median, mean, p5, p95, min, max: of the trials where the figure exists.
        n: how many those are.
    """

    median: float
    mean: float
    p5: float
    p95: float
    min: float
    max: float
    n: int


@dataclass(frozen=True)
class Recording:
    """One trial in time, for plots and films.

    Attributes:
        scenario, controller, seed: of the trial.
        trace: `trace_dtype` records, one a millisecond, (T,).
        boards: the board every `board_every` ticks, uint8 (F, rows, columns); 0 clean, 1 ink, 2 dark object.
        board_every: ticks between boards.
        obstacle: radius m and half length m (0 for a sphere) of the obstacle; None without one.
    """

    scenario: str
    controller: str
    seed: int
    trace: np.ndarray
    boards: np.ndarray
    board_every: int
    obstacle: tuple[float, float] | None = None


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
        """Give each row as a dictionary by column."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]


@dataclass(frozen=True)
class Experiment:
    """Everything one experiment measured.

    Attributes:
        name: as on the command line, such as 'joint-safety'.
        question: what it asks, in a sentence.
        trials: all of them.
        recordings: of one seed, one for each scenario and controller that is to be drawn.
        tables: what else there is to say.
    """

    name: str
    question: str
    trials: tuple[Trial, ...]
    recordings: tuple[Recording, ...] = ()
    tables: tuple[Table, ...] = ()

    def spreads(self) -> dict[str, dict[str, dict[str, Spread]]]:
        """Gather the trials: heading → controller → metric → spread over seeds."""
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
        """Give question, tables, spreads and trials as plain values for JSON; what does not exist is null."""
        spreads = {
            scenario: {
                controller: {name: _plain(asdict(value)) for name, value in row.items()}
                for controller, row in rows.items()
            }
            for scenario, rows in self.spreads().items()
        }
        trials = [_plain(asdict(trial)) for trial in self.trials]
        tables = {table.name: _plain(table.as_records()) for table in self.tables}
        return {"question": self.question, "tables": tables, "spread": spreads, "trials": trials}


def spread(values: list[float]) -> Spread:
    """Summarise one figure over seeds; trials where it does not exist (NaN) are left out."""
    numbers = np.array([value for value in values if np.isfinite(value)])
    if numbers.size == 0:
        nan = float("nan")
        return Spread(nan, nan, nan, nan, nan, nan, 0)
    p5, median, p95 = np.percentile(numbers, [5, 50, 95])
    least, most = float(numbers.min()), float(numbers.max())
    return Spread(float(median), float(numbers.mean()), float(p5), float(p95), least, most, int(numbers.size))


def _plain(value: Any) -> Any:
    """Make a value fit for strict JSON: NaN becomes null, floats keep six significant digits."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value


def to_json(value: Any) -> str:
    """Write strict JSON, indented; a figure that does not exist (NaN) is null."""
    return json.dumps(_plain(value), indent=1, allow_nan=False)
