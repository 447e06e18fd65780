"""The page's sections: each experiment with its film, plots and figures, and where the numbers come from."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import contactsafe
from contactsafe.control import presets
from contactsafe.report import data, html_tables, strip
from contactsafe.report.data import RunInfo, Words
from contactsafe.report.film import film_json
from contactsafe.report.plots import Plotter, spans
from contactsafe.report.summary import versions
from contactsafe.results.experiment import Experiment
from contactsafe.results.figures import Figure
from contactsafe.results.recording import Recording

_COUNTS = {1: "one controller", 2: "two controllers", 3: "three controllers"}


def parts(
    experiments: Sequence[Experiment],
    names: Sequence[str],
    info: RunInfo | Mapping[str, Any],
    words: Words | None = None,
) -> dict[str, str]:
    """Return every piece of the page's template by name, as HTML."""
    plotter = Plotter(names)
    key = [
        f"<dt {html_tables.coloured(name)}>{escape(name)}</dt><dd>{escape(presets.ABOUT.get(name, ''))}</dd>"
        for name in names
    ]
    return {
        "version": escape(str(info.get("version", contactsafe.__version__))),
        **_head(experiments, _COUNTS.get(len(names), f"{len(names)} controllers"), words),
        "key": "\n".join(key),
        "cards": html_tables.cards(experiments, names),
        "results": _results(experiments, names),
        "sections": "\n".join(_section(experiment, names, plotter) for experiment in experiments),
        "method": _method(experiments, names, info, words),
    }


def _results(experiments: Sequence[Experiment], names: Sequence[str]) -> str:
    """Return the section of main figures; nothing where there was no trial."""
    if not any(experiment.trials for experiment in experiments):
        return ""
    figures = html_tables.table(experiments, names, main_only=True) + html_tables.tally(experiments, names)
    return f'<section id="results">\n<h2>Results</h2>\n{figures}\n</section>'


def _head(experiments: Sequence[Experiment], count: str, words: Words | None) -> dict[str, str]:
    """Return title, headline and first sentences of the page: a policy is named only where one was run."""
    if words is not None:
        return {name: escape(getattr(words, name)) for name in ("title", "headline", "introduction")}
    policies = dict.fromkeys(experiment.policy for experiment in experiments if experiment.policy)
    if policies:
        what, headline = "one policy", f"One learned policy, {count}, and contacts nobody planned"
        introduction = (
            f"{escape(' '.join(policies))} It runs unchanged on each of the controllers below; this page shows the "
            "contact forces they allow: on what the tool works on, and on what the rest of the arm runs into."
        )
    else:
        what, headline = "unplanned contacts", f"{count.capitalize()}, and contacts nobody planned"
        introduction = (
            "A simulated arm moves its tool by a script, the same for each of the controllers below; this page shows "
            "what happens when something touches the arm."
        )
    return {"title": f"contactsafe: {count}, {what}", "headline": headline, "introduction": introduction}


def _section(experiment: Experiment, names: Sequence[str], plotter: Plotter) -> str:
    return "\n".join(
        [
            f'<section id="{escape(experiment.name)}">',
            f"<h2>{escape(experiment.title)}</h2>",
            f'<p class="question">{escape(experiment.question)}</p>',
            _film(experiment),
            strip.gallery(experiment.portraits),
            *(_figure(experiment, figure, plotter) for figure in experiment.figures),
            *(html_tables.plain(own) for own in experiment.tables),
            f"<h3>All figures</h3>{html_tables.table([experiment], names)}" if experiment.trials else "",
            html_tables.verdict(experiment, names) if experiment.trials else "",
            "</section>",
        ]
    )


def _film(experiment: Experiment) -> str:
    """Return the film, and a strip of pictures for paper and for browsers without scripts."""
    film = None if experiment.stage is None else film_json(experiment, experiment.stage)
    if experiment.stage is None or film is None:
        return ""
    name = escape(f"film-{experiment.name}")
    return (
        f'<div class="film" data-film="{name}"></div>\n'
        f'<script type="application/json" id="{name}">{film}</script>\n{strip.strips(experiment, experiment.stage)}'
    )


def _figure(experiment: Experiment, figure: Figure, plotter: Plotter) -> str:
    """Return a declared figure: its plots for every recorded scenario, and a caption that says which run is shown."""
    plotted, shown = [], []
    for scenario in data.scenarios(experiment):
        runs = data.recorded(experiment, scenario)
        runs = runs[-1:] if figure.one_controller else runs
        shown += runs
        bands = _bands(runs, figure)
        only = runs[-1].controller if figure.one_controller and runs else None
        plots = [plotter.plot(experiment, scenario, panels, bands, only, figure.columns) for panels in figure.plots]
        plotted += [_titled(scenario, plot) for plot in plots] if len(plots) == 1 else plots
    if not any(plotted):
        return ""
    kind = "plots two" if figure.columns == 2 else "plots"
    caption = f"<figcaption>{escape(figure.caption)} {_shown(shown, figure)}</figcaption>".replace(" </fig", "</fig")
    return f'<figure><div class="{kind}">{"".join(plotted)}</div>{caption}</figure>'


def _bands(runs: Sequence[Recording], figure: Figure) -> list[tuple[float, float]]:
    return spans(data.seconds(runs[0]), figure.shaded(runs[0])) if runs and figure.shaded else []


def _shown(runs: Sequence[Recording], figure: Figure) -> str:
    if figure.of_a_log:
        return ""
    seeds = f"seed {', '.join(str(seed) for seed in sorted({run.seed for run in runs}))}"
    return (
        f"Under {escape(runs[-1].controller)}, {seeds}." if figure.one_controller else f"One run a controller: {seeds}."
    )


def _titled(title: str, plotted: str) -> str:
    return f"<div><h4>{escape(title)}</h4>{plotted}</div>" if plotted else ""


def _method(
    experiments: Sequence[Experiment], names: Sequence[str], info: Mapping[str, Any], words: Words | None
) -> str:
    text = _how_compared(experiments) if words is None else f"<p>{escape(words.method)}</p>"
    found = {**({} if words else _runs(experiments, names, info)), **_made_by(info)}
    return text + '<dl class="info">' + "".join(f"<dt>{k}</dt><dd>{v}</dd>" for k, v in found.items() if v) + "</dl>"


def _how_compared(experiments: Sequence[Experiment]) -> str:
    return (
        "<p>Contact forces and external torques are the simulator's own (MuJoCo at 1 kHz); no controller sees them. "
        "The residual is what a controller's momentum observer makes of its sensors. For one seed, all controllers get "
        f"the same scenes, obstacles, pushes and sensor noise. {_who_acts(experiments)}</p>"
        "<p>Tables give the median over seeds and, in brackets, the 5th and 95th percentile; "
        f"{data.MISSING} stands where no run has the figure. Curves and films show single runs, thinned for drawing so "
        "that peaks stay. <code>summary.json</code> and the CSV files beside this page have every figure of every "
        "run.</p>"
        "<p><strong>What this does not show.</strong> Everything here is simulated, with an arm that is what the "
        "controllers' model of it says, or, where an experiment says so, one with errors sampled at random; a real one "
        "differs in other respects too. The figures compare controllers under equal conditions. "
        "They are no certificate, and no proof that any contact with a person is harmless.</p>"
    )


def _runs(experiments: Sequence[Experiment], names: Sequence[str], info: Mapping[str, Any]) -> dict[str, str]:
    runs = sum(len(experiment.as_dict()["trials"]) for experiment in experiments)
    return {
        "Runs": escape(f"{runs}: {', '.join(names)}") if names else str(runs),
        "Seeds": _seeds(list(info.get("seeds", ()))),
    }


def _made_by(info: Mapping[str, Any]) -> dict[str, str]:
    packages = [f"contactsafe {info.get('version', contactsafe.__version__)}"]
    packages += [f"{name} {number}" for name, number in versions().items()]
    digest = escape(str(info.get("bundle_sha256", "")))
    return {
        "Command": f"<code>{escape(str(info['command']))}</code>" if info.get("command") else "",
        "Policy bundle": f"<code>SHA-256 {digest}</code>" if digest else "",
        "Made": escape(str(info.get("when", ""))),
        "Versions": escape(", ".join(packages)),
    }


def _who_acts(experiments: Sequence[Experiment]) -> str:
    titles = [escape(experiment.title.lower()) for experiment in experiments if experiment.policy]
    scripted = "the tool moves by a script, so that all controllers are asked the same."
    if not titles:
        return scripted.capitalize()
    return f"The policy acts in {' and '.join(titles)}; in other experiments {scripted}"


def _seeds(seeds: Sequence[int]) -> str:
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[-1] + 1)):
        return f"{len(seeds)}: {seeds[0]} to {seeds[-1]}"
    return f"{len(seeds)}: {', '.join(map(str, seeds))}" if seeds else ""
