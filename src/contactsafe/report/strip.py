"""Picture strips: a few moments of every run, for paper and for browsers without scripts."""

from collections.abc import Sequence
from html import escape

import numpy as np

from contactsafe.report import data
from contactsafe.report.film import first_contact, force
from contactsafe.report.html_tables import coloured
from contactsafe.report.scene import fit, picture
from contactsafe.results.experiment import Experiment
from contactsafe.results.recording import Portrait, Recording, Stage
from contactsafe.sim.truth import trace_dtype

WIDTH, HEIGHT = 220, 220
"""Of one picture, px."""


def strips(experiment: Experiment, stage: Stage) -> str:
    """Return one strip a recorded scenario: a row a controller, a column a moment, the force written beneath.

    Args:
        experiment: with recordings.
        stage: arm, tool and surface.
    """
    return "\n".join(_strip(name, data.recorded(experiment, name), stage) for name in data.scenarios(experiment))


def gallery(portraits: Sequence[Portrait]) -> str:
    """Return a picture of each arm, named; nothing where there is none."""
    return "".join(_portrait(portrait) for portrait in portraits)


def _portrait(portrait: Portrait) -> str:
    n, at = len(portrait.q), np.zeros(3) if portrait.sphere is None else portrait.sphere
    trace = np.zeros(1, trace_dtype(n))
    trace["q"], trace["obstacle_position"][:, 0] = portrait.q, at
    sphere = None if portrait.sphere is None else (portrait.radius, 0.0)
    still = Recording(portrait.name, "", 0, trace, sphere)
    image = picture(portrait.stage, fit(portrait.stage, [still]), still, 0, WIDTH, HEIGHT)
    name = escape(portrait.name)
    return (
        f'<figure class="portrait strip"><svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{name}">{image}'
        f"</svg><figcaption>{name}</figcaption></figure>"
    )


def moments(recordings: list[Recording]) -> list[int]:
    """Choose ticks that tell the story: start, approach, first contact, the greatest force, end; else even steps."""
    end = max(len(recording.trace) for recording in recordings) - 1
    contacts = [tick for recording in recordings if (tick := first_contact(recording)) is not None]
    if not contacts:
        return [round(fraction * end) for fraction in (0, 0.25, 0.5, 0.75, 1)]
    strongest = max(recordings, key=lambda recording: recording.trace["obstacle_force"].max())
    first, most = min(contacts), int(np.argmax(strongest.trace["obstacle_force"]))
    return sorted({0, first // 2, first, most, end})


def _strip(scenario: str, recordings: list[Recording], stage: Stage) -> str:
    if not recordings:
        return ""
    view = fit(stage, recordings)
    ticks = moments(recordings)
    body = []
    for recording in recordings:
        cells = []
        for tick in ticks:
            at = min(tick, len(recording.trace) - 1)
            image = picture(stage, view, recording, at, WIDTH, HEIGHT)
            cells.append(
                f'<td><svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(recording.controller)} at '
                f'{tick / 1000:.2f} s">{image}</svg>{_force(recording, at)}</td>'
            )
        body.append(
            f"<tr><th {coloured(recording.controller)}>{escape(recording.controller)}</th>{''.join(cells)}</tr>"
        )
    head = "".join(f"<th>{tick / 1000:.2f} s</th>" for tick in ticks)
    return (
        f'<figure class="strip"><table><thead><tr><th></th>{head}</tr></thead><tbody>{"".join(body)}</tbody></table>'
        f"<figcaption>{escape(scenario)}: the same moments of every run.</figcaption></figure>"
    )


def _force(recording: Recording, tick: int) -> str:
    return f"{data.number(float(force(recording, recording.obstacle is not None)[tick]))} N"
