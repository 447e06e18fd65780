"""Disturbance: lasting pushes of 25 N on the arm while the tool holds and while it wipes; how far does it stray?"""

import math

import numpy as np

from contactsafe.experiments.collision_scenes import sample_plant, scene_rng
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.results import Experiment, Recording, Trial
from contactsafe.experiments.run import Act, Progress, Run, held_out, holding, run_policy
from contactsafe.policy.action_config import ActionConfig
from contactsafe.robot import robots
from contactsafe.sim.config import REAL_SENSORS, WorldConfig
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.tasks import WipingTasks

QUESTION = (
    "Somebody leans on the arm with 25 N while the tool holds still, and while it wipes (K1 = 75 1/s², a soft tool; "
    "plant and sensors differ from the model): how far does the tool stray?"
)
PUSH_N = 25.0
PUSH_S = (0.5, 2.0)
DURATION_S = 2.5
PUSH_POINTS = {4: (-0.0825, 0.12, 0.0), 5: (0.0, 0.0, -0.2), 6: (0.0, 0.0, 0.0)}
"""Where each link is pushed: end of the forearm near the elbow, its middle, the wrist; in the link's frame, m."""

MODES = ("holding", "wiping")
STIFFNESS = (75.0, 75.0, 75.0, 450.0, 450.0, 450.0)
"""K1, 1/s²: a soft tool, near the low end of what a policy may choose."""

_HOLD_HEIGHT = 0.06  # m above the board
_PRESS = 0.004  # depth of x_d below the board while wiping, m
_STROKE, _PERIOD_S = 0.08, 5.0  # half length, m, and period, s, of the strokes


def disturbance(bundle, config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment; it needs no policy, strokes are scripted so that all controllers are asked the same.

    Args:
        bundle: not used.
        config: controllers and seeds.
        progress: told of every trial done.
    """
    trials: list[Trial] = []
    recordings: list[Recording] = []
    for mode in MODES:
        for name in config.controllers:
            for seeds in config.batches():
                calm = _run(mode, name, seeds, None)
                for link in PUSH_POINTS:
                    pushed = _run(mode, name, seeds, link)
                    scenario = f"push on link {link} while {mode}"
                    for i, seed in enumerate(seeds):
                        metrics = deviation_metrics(pushed.traces[i], calm.traces[i])
                        trials.append(Trial(scenario, name, seed, metrics))
                    if config.seed in seeds:
                        pushed.traces[0]["error"][:, :3] = calm.traces[0]["position"] - pushed.traces[0]["position"]
                        recordings.append(pushed.recording(0, scenario, name, config.seed))
                    if progress:
                        progress(len(seeds))
    return Experiment("disturbance", QUESTION, tuple(trials), tuple(recordings))


def push_force(seed: int, link: int) -> np.ndarray:
    """Draw the horizontal direction of one push and give its force, world axes, (3,), N."""
    angle = np.random.default_rng([seed, link]).uniform(-math.pi, math.pi)
    return PUSH_N * np.array([math.cos(angle), math.sin(angle), 0.0])


def _run(mode: str, controller: str, seeds: range, link: int | None) -> Run:
    config = WipingConfig(controller=controller, action=ActionConfig(stiffness_start=STIFFNESS, press=_PRESS))
    arm = robots.panda()
    worlds = [WorldConfig(plant=sample_plant(scene_rng(seed, 0), arm.n), sensors=REAL_SENSORS) for seed in seeds]
    tasks = WipingTasks(config, len(seeds), list(seeds), worlds)
    x, y, z = tasks.config.world.board.centre
    start = np.array([x, y, z + _HOLD_HEIGHT])
    if mode == "wiping":
        start[2] = z + 0.001
    for i, seed in enumerate(seeds):
        tasks.reset(i, held_out(seed), start=start)
        if link is not None:
            tasks.worlds.push(i, f"link{link}", PUSH_POINTS[link], push_force(seed, link), *PUSH_S)
    act = holding() if mode == "holding" else strokes(tasks)
    run = run_policy(tasks, act, round(DURATION_S * 60), stop_when_clean=False)
    tasks.worlds.close()
    return run


def strokes(tasks: WipingTasks) -> Act:
    """Give a script that presses the pad on the board and strokes sideways from where the tool stands."""
    action = tasks.config.action
    step = 0

    def act(observation: dict[str, np.ndarray]) -> np.ndarray:
        nonlocal step
        actions = np.zeros((len(observation["pose"]), 18))
        phase = 2 * math.pi / (60 * _PERIOD_S)
        actions[:, 1] = _STROKE * (math.sin(phase * (step + 1)) - math.sin(phase * step)) / action.translation[1]
        down = (0.001 + _PRESS) / 6  # over the first six steps
        actions[:, 2] = -down / action.translation[2] if step < 6 else 0.0
        step += 1
        return actions

    return act


def deviation_metrics(pushed: np.ndarray, calm: np.ndarray) -> dict[str, float]:
    """Compare a pushed run with the same run left alone: largest departure of the tool along each axis.

    Args:
        pushed, calm: `trace_dtype` records of the two runs, same seed, (T,).
    """
    away = 1000.0 * np.abs(pushed["position"] - calm["position"])
    during = (pushed["time"] >= PUSH_S[0]) & (pushed["time"] < PUSH_S[1])
    names = ("error_x_mm", "error_y_mm", "error_z_mm")
    peaks = away[during].max(axis=0)
    return {name: float(peak) for name, peak in zip(names, peaks, strict=True)} | {
        "error_max_mm": float(peaks.max()),
        "error_end_mm": float(away[during][-1].max()),
        "error_after_mm": float(away[~during & (pushed["time"] >= PUSH_S[1])].max()),
        "tool_force_peak_n": float(np.linalg.norm(pushed["tool_force"], axis=1).max()),
    }
