"""`summary.json`: every figure with its spread, and what made it; the trials as CSV."""

import csv
import io
import json
import math
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import contactsafe
from contactsafe.report.data import RunInfo
from contactsafe.report.output import prepare_output, write_whole
from contactsafe.results.experiment import Experiment

PACKAGES = ("numpy", "numba", "mujoco", "onnxruntime")
"""Packages that figures may depend on."""


def write_summary(folder: str | Path, experiments: Sequence[Experiment], info: RunInfo | Mapping[str, Any]) -> Path:
    """Write `summary.json`.

    Args:
        folder: where to.
        experiments: what was measured.
        info: of the run; entries beyond `RunInfo` are passed on.

    Returns:
        Path of the file.

    Raises:
        OutputError: it cannot be written; nothing is left behind.
    """
    summary = summarise(experiments, info)
    return write_whole(prepare_output(folder) / "summary.json", json.dumps(summary, indent=1, allow_nan=False) + "\n")


def summarise(experiments: Sequence[Experiment], info: RunInfo | Mapping[str, Any]) -> dict[str, Any]:
    """Return what `summary.json` holds: info of the run, versions, experiments by name."""
    head: dict[str, Any] = {"version": contactsafe.__version__}
    head |= {key: list(value) if isinstance(value, tuple | range) else value for key, value in info.items()}
    return head | {
        "versions": versions(),
        "experiments": {experiment.name: experiment.as_dict() for experiment in experiments},
    }


def trials_csv(experiment: Experiment) -> str:
    """Return the trials as CSV: a row each, a column for every metric; empty where a figure does not exist."""
    metrics = list(dict.fromkeys(name for trial in experiment.trials for name in trial.metrics))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["seed", "scenario", "controller", "plant", *metrics])
    for trial in experiment.trials:
        values = (trial.metrics.get(name, math.nan) for name in metrics)
        figures = [repr(float(value)) if math.isfinite(value) else "" for value in values]
        writer.writerow([trial.seed, trial.scenario, trial.controller, trial.plant, *figures])
    return text.getvalue()


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that figures depend on."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
