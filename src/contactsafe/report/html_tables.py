"""Figures as HTML: cards, tables with spreads, sentences about what was missed."""

import math
from collections.abc import Sequence
from html import escape

from contactsafe.report import data, rows
from contactsafe.report.data import MISSING
from contactsafe.report.rows import Line
from contactsafe.results.experiment import Experiment, Table
from contactsafe.results.metrics import BASELINE, ratio
from contactsafe.results.spread import Spread


def coloured(controller: str) -> str:
    """Return the style attribute that makes an element a controller's."""
    return f'style="--c: var({data.css_variable(controller)})"'


def cards(experiments: Sequence[Experiment], names: Sequence[str]) -> str:
    """Return the highlights as cards: the last controller's middle, and those of all beside each other."""
    return "\n".join(_card(line, label, names) for label, line in rows.highlights(experiments))


def _card(line: Line, label: str, names: Sequence[str]) -> str:
    unit, scale = line.metric.unit, line.metric.scale
    middles = {name: scale * line.values[name].middle if name in line.values else math.nan for name in names}
    most = max((value for value in middles.values() if math.isfinite(value)), default=0.0)
    meters = []
    for name, value in middles.items():
        width = 100 * value / most if math.isfinite(value) and most > 0 else 0.0
        meters.append(
            f'<span class="name" {coloured(name)}>{escape(name)}</span>'
            f'<i style="--c: var({data.css_variable(name)}); width: {width:.1f}%"></i>'
            f"<b>{data.number(value)} {unit}</b>"
        )
    subject = names[-1]
    return (
        f'<div class="card"><h3>{escape(label)}</h3>'
        f'<p class="big" {coloured(subject)}>{data.number(middles[subject])} '
        f"<small>{unit}, {escape(subject)}</small></p>"
        f'<div class="meters">{"".join(meters)}</div></div>'
    )


def table(experiments: Sequence[Experiment], names: Sequence[str], main_only: bool = False) -> str:
    """Return a table of figures: median and [5th, 95th percentile] over seeds, ratios to the baseline, aims.

    Args:
        experiments: whose figures.
        names: controllers, one column each.
        main_only: the summary's rows alone, each scenario headed by its experiment.
    """
    others = [name for name in names if name != BASELINE] if BASELINE in names else []
    head = "".join(f"<th {coloured(name)}>{escape(name)}</th>" for name in names)
    head += "".join(f"<th>{escape(name)} / {BASELINE}</th>" for name in others)
    body = []
    for experiment in experiments:
        title = f"{experiment.title}: " if main_only else ""
        for heading, labelled in rows.groups(experiment, main_only):
            width = 3 + len(names) + len(others)
            body.append(f'<tr><th colspan="{width}" scope="rowgroup">{escape(title + heading)}</th></tr>')
            body += [_row(experiment, label, line, names, others) for label, line in labelled]
    return (
        '<div class="wide"><table><thead><tr><th>median [p5, p95] over seeds</th><th></th>'
        f'{head}<th class="aim">aim</th></tr></thead><tbody>{"".join(body)}</tbody></table></div>'
        '<p class="note">✓ reaches the aim, ✗ misses it: compared with the median or mean shown, '
        "“always” on the largest of all runs.</p>"
    )


def _row(experiment: Experiment, label: str, line: Line, names: Sequence[str], others: Sequence[str]) -> str:
    metric = line.metric
    cells = [f"<td>{escape(label)}</td>", f'<td class="unit">{escape(metric.unit)}</td>']
    for name in names:
        value = line.values.get(name)
        where = f"{experiment.name}/{line.scenario}/{name}/{metric.name}"
        exact = f' data-value="{value.middle:.6g}"' if value is not None and math.isfinite(value.middle) else ""
        of = f'data-of="{escape(name)}" {coloured(name)}'
        cells.append(f'<td {of} data-figure="{escape(where)}"{exact}>{_spread(value, metric.scale)}</td>')
    for name in others:
        multiple = data.number(ratio(line.values.get(name), line.baseline))
        cells.append(f'<td data-of="{escape(name)} / {BASELINE}">{multiple}{_mark(line, name)}</td>')
    aim = metric.aim
    cells.append(
        f'<td class="aim" data-of="aim">{escape(aim.text(metric.unit))}</td>' if aim else '<td class="aim"></td>'
    )
    return f"<tr>{''.join(cells)}</tr>"


def _mark(line: Line, name: str) -> str:
    """Return a tick or a cross where there is an aim, and room for it where there is none: ratios stay aligned."""
    reached = line.reaches(name)
    if reached is None:
        return '<span class="mark"></span>'
    kind, title, sign = ("yes", "reached", "✓") if reached else ("no", "missed", "✗")
    return f'<span class="mark {kind}" title="{title}">{sign}</span>'


def plain(table: Table) -> str:
    """Return one of an experiment's own tables."""
    left = [i == 0 or all(isinstance(row[i], str) for row in table.rows) for i in range(len(table.columns))]

    def cells(row: Sequence[str | float], tag: str) -> str:
        marks = [
            f'{" class=word" if word else ""} data-of="{escape(column)}"'
            for word, column in zip(left, table.columns, strict=True)
        ]
        return "".join(f"<{tag}{m}>{escape(data.cell(c))}</{tag}>" for m, c in zip(marks, row, strict=True))

    head = f"<tr>{cells(table.columns, 'th')}</tr>"
    body = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in table.rows)
    return (
        f"<h3>{escape(table.title)}</h3>"
        f'<div class="wide"><table><thead>{head}</thead><tbody>{body}</tbody></table></div>'
        f'<p class="note">{escape(table.note)}</p>'
    )


def tally(experiments: Sequence[Experiment], names: Sequence[str]) -> str:
    """Return a sentence on how many aims of all experiments each controller but the baseline reaches."""
    said = []
    for name in names:
        reached, total = (sum(counts) for counts in zip(*(_count(e, name) for e in experiments), strict=True))
        if name != BASELINE and total:
            said.append(f'<strong class="name" {coloured(name)}>{escape(name)}</strong> reaches {reached} of {total}')
    return f"<p>Of the aims that these runs have figures for, {', '.join(said)}.</p>" if said else ""


def verdict(experiment: Experiment, names: Sequence[str]) -> str:
    """Return for every controller but the baseline how many aims it reaches, and which it misses by how much."""
    out = []
    for name in names:
        reached, total = _count(experiment, name)
        if name == BASELINE or not total:
            continue
        label = f'<strong class="name" {coloured(name)}>{escape(name)}</strong>'
        if reached == total:
            out.append(f'<div class="reached"><p>{label} reaches {reached} of {total} aims.</p></div>')
            continue
        points = "".join(f"<li>{escape(sentence)}</li>" for sentence in rows.shortfalls(experiment, name))
        out.append(
            f'<div class="missed"><p>{label} misses {total - reached} of {total} aims:</p><ul>{points}</ul></div>'
        )
    return "".join(out)


def _count(experiment: Experiment, name: str) -> tuple[int, int]:
    """Return the number of aims reached, and of aims with figures to compare."""
    compared = [line.reaches(name) for line in rows.lines(experiment)]
    return sum(reached is True for reached in compared), sum(reached is not None for reached in compared)


def _spread(value: Spread | None, scale: float) -> str:
    if value is None or not math.isfinite(value.middle):
        return MISSING
    middle, p5, p95 = (data.number(scale * x) for x in (value.middle, value.p5, value.p95))
    return f"{middle} <span>[{p5}, {p95}]</span>"
