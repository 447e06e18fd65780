"""Disturbance: lasting pushes of 25 N on the arm while the tool holds and while it works; how far does it stray?"""

import math
from collections.abc import Sequence

import numpy as np

from contactsafe.experiments.collision_motions import sample_plant, scene_rng
from contactsafe.experiments.config import Entry, ExperimentConfig, Progress
from contactsafe.experiments.franka_links import PUSH_POINTS, require_franka_links
from contactsafe.experiments.run import Run, run_policy, steps_in
from contactsafe.experiments.task import ExperimentTask
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.figures import Figure, Panel, component
from contactsafe.results.metrics import Aim, Highlight, Metric
from contactsafe.results.recording import Recording
from contactsafe.sim.config import SensorConfig, WorldConfig

NAME = "disturbance"
QUESTION = (
    "Somebody leans on the arm with 25 N while the tool holds still, and while it works (K1 = 75 1/s², a soft tool; "
    "plant and sensors differ from the model): how far does the tool stray?"
)
PUSH_N = 25.0
PUSH_S = (0.5, 2.0)
DURATION_S = 2.5
AT_REST = "at rest"
STIFFNESS = (75.0, 75.0, 75.0, 450.0, 450.0, 450.0)
"""K1, 1/s²: a soft tool, near the low end of what a policy may choose."""

METRICS = (
    Metric(
        "error_max_mm", "tool error, largest axis", "mm", main=True,
        aim=Aim(at_most=10.0, where_baseline_above=25.0, ratio_at_most=1 / 3),
    ),
    *(Metric(f"error_{axis}_mm", f"tool error, {axis}", "mm") for axis in "xyz"),
    Metric("error_end_mm", "tool error at the end of the push", "mm"),
    Metric("error_after_mm", "tool error after the push", "mm"),
)  # fmt: skip
HIGHLIGHTS = (Highlight("push on link 5 while at rest", "error_max_mm", "Tool error under a push on the forearm"),)


def during_push(run: Recording) -> np.ndarray:
    """Return which ticks of a recording the push lasts, (T,)."""
    return _lasts(run.trace["time"])


CURVES = Figure(
    plots=(tuple(Panel(f"tool error, {axis}", "mm", component("error", i, 1000.0)) for i, axis in enumerate("xyz")),),
    caption="Departure of the tool from where it is without the push. Shaded: the push.",
    columns=3,
    shaded=during_push,
)


def disturbance(config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment; it needs no policy, motions are scripted so that all controllers are asked the same.

    Args:
        config: controllers, seeds and task.
        progress: told of every trial done.
    """
    task = config.require_task()
    require_franka_links(task.arm)
    trials: list[Trial] = []
    recordings: list[Recording] = []
    for mode in modes(task):
        for name in config.controllers:
            for seeds in config.batches():
                calm = _run(task, mode, name, seeds, None, config.real_sensors)
                for link in PUSH_POINTS:
                    pushed = _run(task, mode, name, seeds, link, config.real_sensors)
                    scenario = f"push on link {link} while {mode}"
                    for i, seed in enumerate(seeds):
                        metrics = deviation_metrics(pushed.traces[i], calm.traces[i])
                        trials.append(Trial(scenario, name, seed, metrics))
                    if config.seed in seeds:
                        pushed.traces[0]["error"][:, :3] = calm.traces[0]["position"] - pushed.traces[0]["position"]
                        recordings.append(pushed.recording(0, scenario, name, config.seed))
                    if progress:
                        progress(len(seeds))
    return Experiment(
        NAME,
        "Disturbance",
        QUESTION,
        trials=tuple(trials),
        metrics=METRICS,
        highlights=HIGHLIGHTS,
        recordings=tuple(recordings),
        figures=(CURVES,),
    )


ENTRY = Entry(
    NAME,
    "somebody leans on the arm with 25 N.",
    disturbance,
    count=lambda config: config.count(2 * len(PUSH_POINTS)),
    takes=("task", "sensors"),
)


def modes(task: ExperimentTask) -> tuple[str, str]:
    """Return what the tool does while the arm is pushed."""
    return (AT_REST, task.name)


def push_force(seed: int, link: int) -> np.ndarray:
    """Sample the horizontal direction of one push; return its force, world axes, (3,), N."""
    angle = np.random.default_rng([seed, link]).uniform(-math.pi, math.pi)
    return PUSH_N * np.array([math.cos(angle), math.sin(angle), 0.0])


def _run(
    task: ExperimentTask, mode: str, controller: str, seeds: Sequence[int], link: int | None, sensors: SensorConfig
) -> Run:
    n = task.arm.n
    worlds = [WorldConfig(plant=sample_plant(scene_rng(seed, 0), n), sensors=sensors) for seed in seeds]
    episodes, act = task.scripted(controller, seeds, worlds, STIFFNESS, works=mode == task.name)
    if link is not None:
        for i, seed in enumerate(seeds):
            episodes.worlds.push(i, f"link{link}", PUSH_POINTS[link], push_force(seed, link), *PUSH_S)
    run = run_policy(episodes, act, steps_in(DURATION_S))
    episodes.worlds.close()
    return run


def deviation_metrics(pushed: np.ndarray, calm: np.ndarray) -> dict[str, float]:
    """Compare a pushed run with the same run left alone: largest departure of the tool along each axis.

    Args:
        pushed, calm: `trace_dtype` records of the two runs, same seed, (T,).
    """
    away = 1000.0 * np.abs(pushed["position"] - calm["position"])
    during = _lasts(pushed["time"])
    names = ("error_x_mm", "error_y_mm", "error_z_mm")
    peaks = away[during].max(axis=0)
    return {name: float(peak) for name, peak in zip(names, peaks, strict=True)} | {
        "error_max_mm": float(peaks.max()),
        "error_end_mm": float(away[during][-1].max()),
        "error_after_mm": float(away[~during & (pushed["time"] >= PUSH_S[1])].max()),
        "tool_force_peak_n": float(np.linalg.norm(pushed["tool_force"], axis=1).max()),
    }


def _lasts(time_s: np.ndarray) -> np.ndarray:
    return (time_s >= PUSH_S[0]) & (time_s < PUSH_S[1])
