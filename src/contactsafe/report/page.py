"""`report.html`: one page that needs nothing but itself."""

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

from contactsafe.report import data
from contactsafe.report.data import RunInfo, Words
from contactsafe.report.output import prepare_output, write_whole
from contactsafe.report.summary import trials_csv, write_summary
from contactsafe.results.experiment import Experiment


def write_report(
    folder: str | Path,
    experiments: Sequence[Experiment],
    info: RunInfo | Mapping[str, Any],
    words: Words | None = None,
) -> Path:
    """Write `summary.json`, every experiment's trials as CSV, and last, as drawing it may fail, `report.html`.

    Args:
        folder: where to.
        experiments: what was measured.
        info: of the run; see `RunInfo`.
        words: what the page says of itself; None for a comparison of controllers.

    Returns:
        Path of the page.

    Raises:
        OutputError: the folder cannot be written; no half-written file is left behind.
    """
    folder = prepare_output(folder)
    write_summary(folder, experiments, info)
    for experiment in experiments:
        write_whole(folder / f"{experiment.name}.csv", trials_csv(experiment))
    return write_whole(folder / "report.html", render(experiments, info, words))


def render(experiments: Sequence[Experiment], info: RunInfo | Mapping[str, Any], words: Words | None = None) -> str:
    """Return the page as text."""
    from contactsafe.report import sections  # brings matplotlib, which the other commands need not wait for

    names = data.controllers(experiments)
    parts = sections.parts(experiments, names, info, words)
    return Template(_file("page.html")).substitute(
        parts, style=_colours(names) + _file("style.css"), script=_file("film.js")
    )


def _colours(names: Sequence[str]) -> str:
    """Each controller's colour as a CSS variable, on light and on dark ground."""
    chosen = data.colours(names)
    light, dark = ("".join(f"{data.css_variable(name)}: {chosen[name][i]}; " for name in names) for i in (0, 1))
    return f":root {{ {light}}}\n@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark}}} }}\n"


def _file(name: str) -> str:
    return (resources.files("contactsafe.report") / name).read_text(encoding="utf-8")
