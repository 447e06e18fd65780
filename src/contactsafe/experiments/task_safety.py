"""Task safety: the policy works on held-out episodes; how strongly does the tool press, and does it work as well?"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from contactsafe.control.codes import FREE
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.config import Entry, ExperimentConfig, Progress
from contactsafe.experiments.run import policy_for, run_policy
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.figures import Figure, Panel, component, length
from contactsafe.results.metrics import CONTACT_N, Aim, Highlight, Metric
from contactsafe.results.recording import Recording

NAME = "task-safety"
QUESTION = (
    "The policy works on episodes it has never seen: does the tool press gently, and does contact safety cost any "
    "success?"
)
METRICS = (
    Metric("tool_force_peak_n", "tool force, peak", "N", main=True),
    Metric("tool_force_median_n", "tool force, median in contact", "N", main=True),
    Metric("tool_force_p95_n", "tool force, 95th percentile in contact", "N"),
    Metric("landing_peak_n", "tool force, peak on landing", "N"),
    Metric("stiffness_z_free", "stiffness along z, in the air", "1/s²"),
    Metric("stiffness_z_contact", "stiffness along z, in contact", "1/s²"),
    Metric("damping_z_free", "damping along z, in the air", "1/s"),
    Metric("damping_z_contact", "damping along z, in contact", "1/s"),
)
"""Those of any task, which says what they should be: `with_aims`."""
FORCES = tuple(
    Panel(f"tool force, {axis}", "N", component("tool_force", i), noisy=True) for i, axis in enumerate("xyz")
)
_FORCE = Panel("force on the tool", "N", length("tool_force"))
IMPEDANCE = Figure(
    plots=(
        (
            _FORCE,
            Panel("stiffness K1 along z", "1/s²", component("K_task", 2)),
            Panel("stiffness K1 along x", "1/s²", component("K_task", 0)),
        ),
        (
            _FORCE,
            Panel("damping D1 along z", "1/s", component("D_task", 2)),
            Panel("damping D1 along x", "1/s", component("D_task", 0)),
        ),
    ),
    caption=f"What the policy does with its impedance. Shaded: contact, above {CONTACT_N} N.",
    shaded=lambda run: _FORCE.curve(run) > CONTACT_N,
    one_controller=True,
)

_LANDING_TICKS = 200  # after the first of them
_Z = 2


def task_safety(config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment; the episode that its task finds most worth showing is recorded.

    Args:
        config: controllers, seeds, task and policy bundle.
        progress: told of every trial done.

    Raises:
        InvalidInputError: there is no task or no policy, or the task has aims for a metric that there is not.
    """
    task, bundle = config.require_task(), config.require_bundle()
    metrics = (*task.metrics, *with_aims(task.aims))
    trials: list[Trial] = []
    recordings: list[Recording] = []
    for name in config.controllers:
        most, shown = -1.0, None  # of the recording
        for seeds in config.batches():
            episodes = task.episodes(name, seeds)
            worth = episodes.worth_showing()
            run = run_policy(episodes, policy_for(bundle, episodes).act, episodes.step_limit, to_the_end=False)
            for i, seed in enumerate(seeds):
                outcome = task.outcome(run.traces[i], run.curves[i], bool(run.succeeded[i]))
                trials.append(Trial(task.name, name, seed, outcome | force_metrics(run.traces[i])))
            i = int(np.argmax(worth))
            if worth[i] > most:  # all controllers get the same episodes: the same one of each
                most, shown = float(worth[i]), run.recording(i, task.name, name, seeds[i])
            episodes.worlds.close()
            if progress:
                progress(len(seeds))
        if shown is not None:
            recordings.append(shown)
    return Experiment(
        NAME,
        "Task safety",
        QUESTION,
        trials=tuple(trials),
        metrics=metrics,
        highlights=(*task.highlights, Highlight(task.name, "tool_force_peak_n", "Peak force of the tool")),
        recordings=tuple(recordings),
        figures=(curves(task.panels), IMPEDANCE),
        stage=task.stage,
        policy=task.policy,
    )


ENTRY = Entry(NAME, "the policy on episodes never seen: tool forces.", task_safety, takes=("task", "bundle"))


def with_aims(aims: Mapping[str, Aim]) -> tuple[Metric, ...]:
    """Return `METRICS` with what a task says that they should be, by name.

    Raises:
        InvalidInputError: there is no metric of a name.
    """
    names = [metric.name for metric in METRICS]
    if unknown := set(aims) - set(names):
        raise InvalidInputError(f"the task has aims for {', '.join(sorted(unknown))}; choose from {', '.join(names)}")
    return tuple(replace(metric, aim=aims.get(metric.name)) for metric in METRICS)


def force_metrics(trace: np.ndarray) -> dict[str, float]:
    """Summarise forces and impedance of one episode.

    Args:
        trace: `trace_dtype` records, (T,).
    """
    force = np.linalg.norm(trace["tool_force"], axis=1)
    touching = force > CONTACT_N
    return {
        "tool_force_peak_n": float(force.max()),
        "tool_force_median_n": float(np.median(force[touching])) if touching.any() else float("nan"),
        "landing_peak_n": landing_peak(force, touching),
        "stiffness_z_free": _mean(trace["K_task"][~touching, _Z]),
        "stiffness_z_contact": _mean(trace["K_task"][touching, _Z]),
        "damping_z_free": _mean(trace["D_task"][~touching, _Z]),
        "damping_z_contact": _mean(trace["D_task"][touching, _Z]),
        "tool_force_p95_n": float(np.percentile(force[touching], 95)) if touching.any() else float("nan"),
        "contact_mode_fraction": float((trace["mode"] != FREE).mean()),
    }


def curves(of_task: Sequence[Panel]) -> Figure:
    """Return the figure of the tool's force and of the task's own curves."""
    labels = "".join(f"; {panel.label}" for panel in of_task)
    return Figure(
        plots=tuple((panel,) for panel in (*FORCES, *of_task)),
        caption=f"Force on the tool along the world's axes, mean and, pale, range{labels}.",
    )


def landing_peak(force: np.ndarray, touching: np.ndarray) -> float:
    """Return the largest force within 0.2 s of the first touch, N; NaN where nothing was touched.

    Args:
        force: on the tool, tick by tick, (T,), N.
        touching: which ticks count as contact, (T,).
    """
    if not touching.any():
        return float("nan")
    first = int(np.argmax(touching))
    return float(force[first : first + _LANDING_TICKS].max())


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")
