"""Joint safety: while the policy works, the forearm runs into something that is held in its path."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from contactsafe.control.codes import FREE
from contactsafe.experiments.config import Entry, ExperimentConfig, Progress
from contactsafe.experiments.franka_links import FOREARM, require_franka_links
from contactsafe.experiments.obstacle_metrics import last_part, obstacle_metrics
from contactsafe.experiments.run import policy_for, run_policy, steps_in
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.figures import Figure, Panel, largest, scalar
from contactsafe.results.metrics import CONTACT_N, Aim, Highlight, Metric
from contactsafe.results.recording import Recording
from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.shape import arm_capsules
from contactsafe.sim.obstacles import Obstacle, bottle, thrust_meter

NAME = "joint-safety"
QUESTION = "While the policy works, something is held in the forearm's path: what are the contact forces?"
OBSTACLES: dict[str, Callable[..., Obstacle]] = {"bottle": bottle, "thrust meter": thrust_meter}
DURATION_S = 10.0
STEADY_S = 2.0
"""The last part of a run, over which steady figures are means: bouncing counts with all its impacts, s."""

METRICS = (
    Metric("contact_steady_n", "contact force, steady", "N", main=True, aim=Aim(ratio_at_most=1 / 3)),
    Metric("contact_peak_n", "contact force, peak", "N", main=True, aim=Aim(ratio_at_most=1 / 2)),
    Metric("impulse_ns", "impulse of the contact", "N s"),
    Metric(
        "tau_steady_nm", "external joint torque, steady", "N m", main=True,
        aim=Aim(at_most=5.0, where_baseline_above=8.0),
    ),
    Metric("tau_peak_nm", "external joint torque, peak", "N m"),
    Metric("residual_steady_nm", "residual compensated by this controller, steady", "N m"),
    Metric("residual_peak_nm", "residual compensated by this controller, peak", "N m"),
    Metric("detect_ms", "contact to its detection", "ms"),
    Metric("met", "runs that met the obstacle", "%", 100.0),
)  # fmt: skip
HIGHLIGHTS = (
    Highlight("bottle", "contact_steady_n", "Steady force on the bottle the arm ran into"),
    Highlight("thrust meter", "contact_peak_n", "Peak force on the thrust meter the arm ran into"),
)
CURVES = Figure(
    plots=(
        (
            Panel("contact force", "N", scalar("obstacle_force")),
            Panel("external torque", "N m", largest("tau_arm")),
            Panel("residual", "N m", largest("residual")),
        ),
    ),
    caption="Force of the obstacle on the arm; external torque and observer's residual, the largest of all joints. "
    "Shown is the first seed with which every arm met it, if there is one.",
)


def joint_safety(config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment.

    Args:
        config: controllers, seeds, task and policy bundle.
        progress: told of every trial done.
    """
    trials: list[Trial] = []
    recordings: list[Recording] = []
    for scenario in OBSTACLES:
        runs: dict[int, list[Recording]] = {}
        for name in config.controllers:
            for seeds in config.batches():
                for recording in _collide(config, scenario, name, seeds):
                    trials.append(Trial(scenario, name, recording.seed, contact_metrics(recording.trace)))
                    if config.seed in seeds:
                        runs.setdefault(recording.seed, []).append(recording)
                if progress:
                    progress(len(seeds))
        recordings += worth_showing(runs)
    task = config.require_task()
    return Experiment(
        NAME,
        "Joint safety",
        QUESTION,
        trials=tuple(trials),
        metrics=METRICS,
        highlights=HIGHLIGHTS,
        recordings=tuple(recordings),
        figures=(CURVES,),
        stage=task.stage,
        policy=task.policy,
    )


ENTRY = Entry(
    NAME,
    "the forearm runs into an obstacle while the policy works.",
    joint_safety,
    count=lambda config: config.count(len(OBSTACLES)),
    takes=("task", "bundle"),
)


def worth_showing(runs: Mapping[int, list[Recording]]) -> list[Recording]:
    """Choose the first seed with which every arm met the obstacle; the first of all where there is none."""
    met = [all((r.trace["obstacle_force"] > CONTACT_N).any() for r in recordings) for recordings in runs.values()]
    return list(runs.values())[met.index(True) if True in met else 0]


def _collide(config: ExperimentConfig, scenario: str, controller: str, seeds: Sequence[int]) -> list[Recording]:
    make = OBSTACLES[scenario]
    episodes = config.require_task().towards_obstacle(
        controller, seeds, lambda arm, q: make(place_before_forearm(arm, q, make))
    )
    run = run_policy(episodes, policy_for(config.require_bundle(), episodes).act, steps_in(DURATION_S))
    obstacle = episodes.worlds.configs[0].obstacles[0]
    episodes.worlds.close()
    shape = (obstacle.radius, obstacle.half_length)
    return [run.recording(i, scenario, controller, seed, shape) for i, seed in enumerate(seeds)]


def place_before_forearm(arm: Arm, q: np.ndarray, make: Callable[..., Obstacle]) -> tuple[float, float, float]:
    """Return where an obstacle touches the forearm from its right.

    Args:
        arm: built from a description.
        q: joint positions at which the forearm is to meet it, (n,), rad.
        make: the obstacle's kind.

    Returns:
        Centre of the obstacle, x, y, z, m.
    """
    middle, radius = forearm(arm, q)
    gap = radius + make((0.0, 0.0, 0.0)).radius
    return (float(middle[0]), float(middle[1] - gap), float(middle[2]))


def forearm(arm: Arm, q: np.ndarray) -> tuple[np.ndarray, float]:
    """Return middle, (3,) m, and radius, m, of the forearm's thickest capsule at q (n,) rad.

    Raises:
        InvalidInputError: the arm is not built of links as Franka's are, or nobody says of which.
    """
    require_franka_links(arm)
    starts, ends, radii, links = arm_capsules(*description_and_tool(arm), q[None])
    of_link = np.flatnonzero(np.asarray(links) == FOREARM)
    thickest = of_link[np.argmax(radii[of_link])]
    return (starts[0, thickest] + ends[0, thickest]) / 2, float(radii[thickest])


def contact_metrics(trace: np.ndarray) -> dict[str, float]:
    """Summarise one collision; all but `met` are NaN where the arm met nothing.

    Args:
        trace: `trace_dtype` records, (T,).
    """
    found = obstacle_metrics(trace, STEADY_S, of_met_only=True, reported_before_ms=math.nan)
    residual = np.abs(trace["residual"]).max(axis=1)
    more = {
        "residual_peak_nm": float(residual.max()),
        "residual_steady_nm": float(residual[last_part(trace, STEADY_S)].mean()),
        "tool_force_peak_n": float(np.linalg.norm(trace["tool_force"], axis=1).max()),
        "mode_switches": float(np.count_nonzero(np.diff(trace["mode"] != FREE))),
    }
    return found | (more if found["met"] else dict.fromkeys(more, math.nan))
