"""`summary.json`: every figure with its spread, and what made it."""

import json
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import contactsafe
from contactsafe.report.data import Experiment, RunFacts
from contactsafe.report.output import prepare_output, write_whole

PACKAGES = ("numpy", "numba", "mujoco", "onnxruntime")
"""Packages that figures may depend on."""


def write_summary(folder, experiments: Sequence[Experiment], facts: RunFacts | Mapping[str, Any]) -> Path:
    """Write `summary.json`.

    Args:
        folder: where to.
        experiments: what was measured.
        facts: of the run; entries beyond `RunFacts` are passed on.

    Returns:
        Path of the file.

    Raises:
        OutputError: it cannot be written; nothing is left behind.
    """
    summary = summarise(experiments, facts)
    return write_whole(prepare_output(folder) / "summary.json", json.dumps(summary, indent=1, allow_nan=False) + "\n")


def summarise(experiments: Sequence[Experiment], facts: RunFacts | Mapping[str, Any]) -> dict[str, Any]:
    """Give what `summary.json` holds: facts of the run, versions, experiments by name."""
    head: dict[str, Any] = {"version": contactsafe.__version__}
    head |= {key: list(value) if isinstance(value, tuple | range) else value for key, value in facts.items()}
    return head | {
        "versions": versions(),
        "experiments": {experiment.name: experiment.as_dict() for experiment in experiments},
    }


def versions() -> dict[str, str]:
    """Give the versions of Python and of the packages that figures depend on."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
