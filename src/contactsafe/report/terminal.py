"""The experiments' main figures as plain text."""

import math
import textwrap
from collections.abc import Sequence

from contactsafe.report import data, rows
from contactsafe.results.experiment import Experiment, Table
from contactsafe.results.metrics import BASELINE, ratio
from contactsafe.results.spread import Spread

_LABEL = 31
_WIDTH = 110


def terminal_table(experiments: Sequence[Experiment]) -> str:
    """Return the main figures for a terminal: median and [5th, 95th percentile] over seeds, in ASCII.

    The last columns give the ratio of the last controller's median to the baseline's, and the aim with "ok" or "MISSED"
    where there is a figure; where one metric heads several scenarios, the heading says its aim once for all of them.
    The experiments' own tables follow.

    Args:
        experiments: what was measured.

    Returns:
        Lines joined by newlines, without one at the end.
    """
    names = data.controllers(experiments)
    subject = names[-1] if names else ""
    table: list[list[str]] = [["median [p5, p95] over seeds", "", *names, f"{subject}/{BASELINE}", "aim"]]
    for experiment in experiments:
        for heading, labelled in rows.groups(experiment, main_only=True):
            shared = _shared_aim([line for _, line in labelled])
            table.append([f"{experiment.title}: {heading}" + (f"; aim: {_ascii(shared)}" if shared else "")])
            table += [_row(label, line, names, aim=not shared) for label, line in labelled]
    figures = [] if experiments and not any(experiment.trials for experiment in experiments) else [_align(table)]
    return "\n\n".join(figures + [_plain(own) for experiment in experiments for own in experiment.tables])


def _plain(table: Table) -> str:
    """Return a table as it is: its first column to the left, words to the left, numbers to the right."""
    cells = [[_ascii(data.cell(value)) for value in row] for row in table.rows]
    widths = [max(map(len, column)) for column in zip(table.columns, *cells, strict=True)]
    words = [i == 0 or all(isinstance(row[i], str) for row in table.rows) for i in range(len(widths))]

    def line(row: Sequence[str]) -> str:
        padded = [c.ljust(w) if left else c.rjust(w) for c, w, left in zip(row, widths, words, strict=True)]
        return "  " + "  ".join(padded).rstrip()

    note = textwrap.wrap(_ascii(table.note), _WIDTH, initial_indent="  ", subsequent_indent="  ")
    return "\n".join([_ascii(table.title), line(table.columns), *map(line, cells), *note])


def _shared_aim(lines: Sequence[rows.Line]) -> str:
    """Return the aim of lines that are one metric in several scenarios, else nothing."""
    metric = lines[0].metric
    one = len(lines) > 1 and all(line.metric is metric for line in lines)
    return metric.aim.text(metric.unit) if one and metric.aim else ""


def _row(label: str, line: rows.Line, names: Sequence[str], aim: bool) -> list[str]:
    metric, subject = line.metric, names[-1]
    said = [metric.aim.text(metric.unit)] if aim and metric.aim else []
    said += {True: ["ok"], False: ["MISSED"], None: []}[line.reaches(subject)]
    return [
        f"  {label}",
        metric.unit,
        *(_cell(line.values.get(name), metric.scale) for name in names),
        _ascii(data.number(ratio(line.values.get(subject), line.baseline))),
        _ascii(" ".join(said)),
    ]


def _cell(value: Spread | None, scale: float) -> str:
    if value is None or not math.isfinite(value.middle):
        return "-"
    middle, p5, p95 = (_ascii(data.number(scale * x)) for x in (value.middle, value.p5, value.p95))
    return f"{middle} [{p5}, {p95}]"


def _align(table: list[list[str]]) -> str:
    full = [cells for cells in table if len(cells) > 1]
    widths = [max(len(cells[i]) for cells in full) for i in range(len(full[0]))]
    out = []
    for cells in table:
        if len(cells) == 1:
            out += ["", cells[0]]
            continue
        first, unit, *middle, aim = cells
        padded = [first.ljust(max(widths[0], _LABEL)), unit.ljust(widths[1])]
        padded += [cell.rjust(width) for cell, width in zip(middle, widths[2:-1], strict=True)]
        out.append("  ".join([*padded, aim]).rstrip())
    return "\n".join(out)


def _ascii(text: str) -> str:
    """Return a text that terminals and pipes of any encoding take."""
    for sign, plain in (("−", "-"), (data.MISSING, "-")):
        text = text.replace(sign, plain)
    return text
