"""A run over a robot's own network protocol, simulated: was the work done, and how gently, whatever met the arm?"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from contactsafe.hardware.ending import BUSY_EDGES_US, Ending
from contactsafe.results.experiment import Experiment, Table, Trial
from contactsafe.results.figures import Figure, Panel
from contactsafe.results.metrics import CONTACT_N, Aim, Metric
from contactsafe.results.recording import Recording
from contactsafe.sim.franka_meetings import FOR_S, GOES_S, REST_S

NAME = "run"
QUESTION = (
    "A policy works on a simulated Franka over the robot's own protocol; a bottle held by 2 kN/m is in the path of its "
    "wrist, and a person pushes it with 25 N: is the work done, and how gently?"
)
SCENARIO = "simulated Franka"

METRICS = (
    Metric("pushed_mm", "tool moved by 25 N on link 5, at rest", "mm", main=True, aim=Aim(ratio_at_most=1 / 3)),
    Metric("met_peak_n", "force of the bottle on the arm, peak until it is taken away", "N", main=True),
    Metric("met_steady_n", "the same, steady", "N", main=True, aim=Aim(ratio_at_most=1 / 3)),
    Metric("tip_peak_n", "force on the tool, peak", "N", main=True),
    Metric("tip_contact_n", "the same, median in contact", "N"),
    Metric("work_fraction", "work done", "%", scale=100.0, main=True, aim=Aim(at_least=95.0)),
)


@dataclass(frozen=True)
class RobotRun:
    """One run.

    Attributes:
        controller: preset by name.
        truth: what really happened, `truth_dtype` records.
        ending: of the run.
        figures: of the task, by name.
        met: whether anything pushed or met the arm.
    """

    controller: str
    truth: np.ndarray
    ending: Ending
    figures: Mapping[str, float]
    met: bool


def robot_runs(runs: Sequence[RobotRun], seed: int) -> Experiment:
    """Return what runs of several controllers measured."""
    return Experiment(
        NAME,
        "A run over the robot's protocol",
        QUESTION,
        trials=tuple(Trial(SCENARIO, run.controller, seed, metrics_of(run)) for run in runs),
        metrics=METRICS,
        recordings=tuple(Recording(SCENARIO, run.controller, seed, run.truth) for run in runs if len(run.truth)),
        figures=(CURVES,),
        tables=(_table(runs),),
    )


def metrics_of(run: RobotRun) -> dict[str, float]:
    """Return the figures of one run; NaN where nothing pushed or met the arm."""
    truth, tip = run.truth, run.truth["tip_n"]
    pressed = tip[tip > CONTACT_N]
    figures = {
        "tip_peak_n": float(tip.max(initial=0.0)),
        "tip_contact_n": float(np.median(pressed)) if len(pressed) else math.nan,
        "work_fraction": min((x for name, x in run.figures.items() if name.startswith("done")), default=math.nan),
    }
    if not run.met:
        return {"pushed_mm": math.nan, "met_peak_n": math.nan, "met_steady_n": math.nan, **figures}
    return {"pushed_mm": _moved_mm(truth), **_met(truth), **figures}


def _between(truth: np.ndarray, start_s: float, end_s: float) -> np.ndarray:
    return truth[(truth["time"] >= start_s) & (truth["time"] < end_s)]


def _moved_mm(truth: np.ndarray) -> float:
    """Return how far the push at rest moved the tool from where it was."""
    before, pushed = _between(truth, REST_S - 0.1, REST_S), _between(truth, REST_S, REST_S + FOR_S)
    if not (len(before) and len(pushed)):
        return math.nan
    away = pushed["position"] - before["position"].mean(axis=0)
    return 1000.0 * float(np.linalg.norm(away, axis=1).max())


def _met(truth: np.ndarray) -> dict[str, float]:
    """Return peak and steady force of the bottle; steady is the last half second before it is taken away."""
    there, steady = _between(truth, 0.0, GOES_S), _between(truth, GOES_S - 0.5, GOES_S)
    peak = float(there["arm_n"].max(initial=0.0))
    return {"met_peak_n": peak, "met_steady_n": float(steady["arm_n"].mean()) if len(steady) else math.nan}


def _meets(run: Recording) -> np.ndarray:
    """Return in which ticks something pushes or meets the arm, (T,)."""
    return (run.trace["pushed_n"] > 0.0) | (run.trace["arm_n"] > CONTACT_N)


CURVES = Figure(
    plots=(
        (
            Panel("force on the tool", "N", lambda run: run.trace["tip_n"], noisy=True),
            Panel("force of the bottle on the arm", "N", lambda run: run.trace["arm_n"]),
            Panel("height of the tool", "mm", lambda run: 1000.0 * run.trace["position"][:, 2]),
        ),
    ),
    caption="What really acted on the robot; the policy and the controller know its joints and pictures alone. Shaded: "
    "somebody pushes the arm, or a bottle touches it.",
    shaded=_meets,
)


def _table(runs: Sequence[RobotRun]) -> Table:
    """Return how the runs went beside the forces."""
    names = list(dict.fromkeys(name for run in runs for name in run.figures))
    rows: list[tuple[str | float, ...]] = [("ended", *(run.ending.state for run in runs))]
    rows.append(("because", *(run.ending.reason for run in runs)))
    rows += [(name, *(run.figures.get(name, math.nan) for run in runs)) for name in names]
    for label, value in _ENDING.items():
        rows.append((label, *(float(value(run.ending)) for run in runs)))
    rows += _histogram(runs)
    return Table(
        "runs", "How the runs went", ("figure", *(run.controller for run in runs)), tuple(rows),
        note="Busy: from the arrival of the robot's state to its command, what the loop takes of a tick.",
    )  # fmt: skip


def _histogram(runs: Sequence[RobotRun]) -> list[tuple[str | float, ...]]:
    """Return in how many ticks of each run the loop was busy for how long."""
    labels = [f"{start} to {end} µs" for start, end in zip((0, *BUSY_EDGES_US), BUSY_EDGES_US[:-1], strict=False)]
    labels.append(f"{BUSY_EDGES_US[-2]} µs or more")
    return [
        (f"ticks busy for {label}", *(float(run.ending.busy_ticks[k]) for run in runs))
        for k, label in enumerate(labels)
    ]


_ENDING = {
    "control ticks": lambda ending: ending.ticks,
    "robot states lost": lambda ending: ending.lost,
    "targets refused": lambda ending: ending.refused,
    "first torque step (N m)": lambda ending: ending.first_step_nm,
    "largest later one (N m)": lambda ending: ending.largest_step_nm,
    "busy, median (µs)": lambda ending: ending.busy_us[0],
    "busy, 99th percentile (µs)": lambda ending: ending.busy_us[1],
    "busy, most (µs)": lambda ending: ending.busy_us[2],
    "ticks over 500 µs": lambda ending: ending.busy_us[3],
    "ticks in the log": lambda ending: ending.recorded,
}
