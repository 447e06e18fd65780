"""The page's sections: each experiment with its film, plots and figures, and where the numbers come from."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

import contactsafe
from contactsafe.report import data, rows, strip, tables
from contactsafe.report.data import Experiment, Recording, RunInfo
from contactsafe.report.film import film_json
from contactsafe.report.plots import Curve, Panel, Plotter, spans
from contactsafe.report.scene import Subject
from contactsafe.report.summary import versions
from contactsafe.robot.panda import PANDA, WIPING_PAD
from contactsafe.sim.config import BoardConfig
from contactsafe.tasks.base.evaluation import CONTACT_N

SUBJECT = Subject(PANDA, WIPING_PAD, BoardConfig())
"""What the experiments simulate."""

ABOUT = {
    "vices": "the baseline: variable impedance control (Martín-Martín et al. 2019) with a posture task, "
    "blind to contact of the arm",
    "paper": "the contact-aware controller with the parameters of its paper",
    "safe": "this package's default: the paper's laws, a fast trigger, null-space damping and a bounded push",
}
"""The known controllers in a few words."""

_OF_POLICY = ("task-safety", "joint-safety")
_COUNTS = {1: "one controller", 2: "two controllers", 3: "three controllers"}


def parts(experiments: Sequence[Experiment], names: Sequence[str], info: RunInfo | Mapping[str, Any]) -> dict[str, str]:
    """Give every piece of the page's template by name, as HTML."""
    plotter = Plotter(names)
    key = [f"<dt {tables.coloured(name)}>{escape(name)}</dt><dd>{escape(ABOUT.get(name, ''))}</dd>" for name in names]
    return {
        "version": escape(str(info.get("version", contactsafe.__version__))),
        **_head(experiments, _COUNTS.get(len(names), f"{len(names)} controllers")),
        "key": "\n".join(key),
        "cards": tables.cards(experiments, names),
        "results": tables.table(experiments, names, main_only=True) + tables.tally(experiments, names),
        "sections": "\n".join(_section(experiment, names, plotter, info) for experiment in experiments),
        "method": _method(experiments, names, info),
    }


def _head(experiments: Sequence[Experiment], count: str) -> dict[str, str]:
    """Give title, headline and first sentences of the page: a policy is named only where one was run."""
    if not experiments or any(experiment.name in _OF_POLICY for experiment in experiments):
        what, headline = "one policy", f"One learned policy, {count}, and contacts nobody planned"
        lead = (
            "A learned policy wipes ink off a whiteboard with a simulated Franka Panda. It runs unchanged on each of "
            "the controllers below; this page shows how hard they let it press: on what the tool works on, and on what "
            "the rest of the arm runs into."
        )
    else:
        what, headline = "unplanned contacts", f"{count.capitalize()}, and contacts nobody planned"
        lead = (
            "A simulated Franka Panda moves its tool by a script, the same for each of the controllers below; this "
            "page shows what becomes of it when something touches the arm."
        )
    return {"title": f"contactsafe: {count}, {what}", "headline": headline, "lead": lead}


def _section(experiment: Experiment, names: Sequence[str], plotter: Plotter, info: Mapping[str, Any]) -> str:
    title = rows.TITLES.get(experiment.name, experiment.name)
    return "\n".join(
        [
            f'<section id="{escape(experiment.name)}">',
            f"<h2>{escape(title)}</h2>",
            f'<p class="question">{escape(experiment.question)}</p>',
            _film(experiment),
            _curves(experiment, plotter, info),
            *(tables.plain(own) for own in experiment.tables),
            f"<h3>All figures</h3>{tables.table([experiment], names)}",
            tables.verdict(experiment, names),
            "</section>",
        ]
    )


def _film(experiment: Experiment) -> str:
    """The film, and a strip of pictures for paper and for browsers without scripts."""
    if experiment.name not in ("joint-safety", "task-safety"):
        return ""
    film = film_json(experiment, SUBJECT)
    if film is None:
        return ""
    name = escape(f"film-{experiment.name}")
    return (
        f'<div class="film" data-film="{name}"></div>\n'
        f'<script type="application/json" id="{name}">{film}</script>\n{strip.strips(experiment, SUBJECT)}'
    )


def _curves(experiment: Experiment, plotter: Plotter, info: Mapping[str, Any]) -> str:
    names = data.scenarios(experiment)
    if experiment.name == "joint-safety":
        panels = [
            Panel("contact force (N)", lambda run: run.trace["obstacle_force"]),
            Panel("external torque (N m)", lambda run: _largest(run.trace["tau_arm"])),
            Panel("residual (N m)", lambda run: _largest(run.trace["residual"])),
        ]
        drawn = [_titled(name, plotter.plot(experiment, name, panels)) for name in names]
        said = "Force of the obstacle on the arm; external torque and observer's residual, the largest of all joints. "
        said += "Shown is the first seed with which every arm met it, if there is one."
        return _figure(drawn, experiment, said, "plots two")
    if experiment.name == "task-safety":
        single = [
            Panel(f"tool force, {axis} (N)", _component("tool_force", i), noisy=True) for i, axis in enumerate("xyz")
        ]
        single.append(Panel("ink left (%)", lambda run: 100 * run.trace["ink_left"]))
        drawn = [plotter.plot(experiment, name, [panel]) for name in names for panel in single]
        said = "Force of the board on the tool along the world's axes, mean and, pale, range; ink left."
        return _figure(drawn, experiment, said, "plots two") + "".join(
            _impedance(experiment, name, plotter) for name in names
        )
    if experiment.name == "disturbance":
        panels = [Panel(f"tool error, {axis} (mm)", _component("error", i, 1000.0)) for i, axis in enumerate("xyz")]
        bands = [info["push_s"]] if info.get("push_s") else []
        drawn = [_titled(name, plotter.plot(experiment, name, panels, bands, columns=3)) for name in names]
        said = "Departure of the tool from where it is without the push." + (" Shaded: the push." if bands else "")
        return _figure(drawn, experiment, said, "plots")
    if experiment.name == "collisions":
        panels = [
            Panel("contact force (N)", lambda run: run.trace["obstacle_force"]),
            Panel("mode: 0 free, 1 comply, 2 reject", lambda run: run.trace["mode"]),
            Panel("tool away from its free motion (mm)", lambda run: _length(run.trace["error"][:, :3], 1000.0)),
        ]
        drawn = [_titled(name, plotter.plot(experiment, name, panels)) for name in names]
        said = "Force of the obstacle on the arm, of two the larger; what the controller takes it for; the tool."
        return _figure(drawn, experiment, said, "plots two")
    return ""


def _impedance(experiment: Experiment, scenario: str, plotter: Plotter) -> str:
    """How stiff and how damped the policy makes the arm over one board, under the last controller, against contact."""
    runs = data.recorded(experiment, scenario)
    if not runs:
        return ""
    force = Panel("force on the tool (N)", lambda run: _length(run.trace["tool_force"], 1.0))
    sides = [
        [
            force,
            Panel("stiffness K1 towards the board, z (1/s²)", _component("K_task", 2)),
            Panel("stiffness K1 along the board, x (1/s²)", _component("K_task", 0)),
        ],
        [
            force,
            Panel("damping D1 towards the board, z (1/s)", _component("D_task", 2)),
            Panel("damping D1 along the board, x (1/s)", _component("D_task", 0)),
        ],
    ]
    run = runs[-1]
    contact = spans(data.seconds(run), force.curve(run) > CONTACT_N)
    drawn = "".join(plotter.plot(experiment, scenario, panels, contact, run.controller) for panels in sides)
    said = f"What the policy does with its impedance, under {run.controller}, seed {run.seed}. "
    said += f"Shaded: contact, above {CONTACT_N} N."
    return f'<figure><div class="plots two">{drawn}</div><figcaption>{said}</figcaption></figure>'


def _figure(drawn: Sequence[str], experiment: Experiment, said: str, kind: str) -> str:
    if not any(drawn):
        return ""
    seeds = sorted({recording.seed for recording in experiment.recordings})
    shown = f"seed {', '.join(map(str, seeds))}"
    caption = f"<figcaption>{said} One run a controller: {shown}.</figcaption>"
    return f'<figure><div class="{kind}">{"".join(drawn)}</div>{caption}</figure>'


def _titled(title: str, drawn: str) -> str:
    return f"<div><h4>{escape(title)}</h4>{drawn}</div>" if drawn else ""


def _largest(torques: np.ndarray) -> np.ndarray:
    return np.abs(torques).max(axis=1)


def _length(vectors: np.ndarray, scale: float) -> np.ndarray:
    return scale * np.linalg.norm(vectors, axis=1)


def _component(field: str, index: int, scale: float = 1.0) -> Curve:
    def curve(recording: Recording) -> np.ndarray:
        return scale * recording.trace[field][:, index]

    return curve


def _method(experiments: Sequence[Experiment], names: Sequence[str], info: Mapping[str, Any]) -> str:
    runs = sum(len(experiment.as_dict()["trials"]) for experiment in experiments)
    seeds = list(info.get("seeds", ()))
    text = (
        "<p>Contact forces and external torques are the simulator's own (MuJoCo at 1 kHz); no controller sees them. "
        "The residual is what a controller's momentum observer makes of its sensors. For one seed, all controllers get "
        "the same boards, obstacles, pushes and sensor noise. The policy acts in task and joint safety; in "
        "the other experiments the tool holds, strokes or sweeps by a script, so that all controllers are asked the "
        "same.</p>"
        "<p>Tables give the median over seeds and, in brackets, the 5th and 95th percentile; "
        f"{data.MISSING} stands where no run has the figure. Curves and films show single runs, thinned for drawing so "
        "that peaks stay. <code>summary.json</code> and the CSV files beside this page have every figure of every "
        "run.</p>"
        "<p><strong>What this does not show.</strong> Everything here is simulated, with an arm that is what the "
        "controllers' model of it says, or in collisions and detection one with errors drawn at random; a real one "
        "differs in other ways too. The figures compare controllers under equal conditions. "
        "They are no certificate, and no proof that any contact with a person is harmless.</p>"
    )
    found = {
        "Runs": escape(f"{runs}: {', '.join(names)}") if names else str(runs),
        "Seeds": _seeds(seeds),
        "Command": f"<code>{escape(str(info['command']))}</code>" if info.get("command") else "",
        "Policy bundle": f"<code>SHA-256 {escape(str(info['bundle_sha256']))}</code>"
        if info.get("bundle_sha256")
        else "",
        "Made": escape(str(info.get("when", ""))),
        "Versions": escape(
            ", ".join(
                [f"contactsafe {info.get('version', contactsafe.__version__)}"]
                + [f"{name} {number}" for name, number in versions().items()]
            )
        ),
    }
    return text + '<dl class="info">' + "".join(f"<dt>{k}</dt><dd>{v}</dd>" for k, v in found.items() if v) + "</dl>"


def _seeds(seeds: Sequence[int]) -> str:
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[-1] + 1)):
        return f"{len(seeds)}: {seeds[0]} to {seeds[-1]}"
    return f"{len(seeds)}: {', '.join(map(str, seeds))}" if seeds else ""
