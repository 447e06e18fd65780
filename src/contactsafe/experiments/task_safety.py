"""Task safety: the policy wipes held-out boards; how hard does the tool press, and does it wipe as well?"""

import numpy as np

from contactsafe.control.codes import FREE
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.results import Experiment, Recording, Trial
from contactsafe.experiments.run import Progress, held_out, policy_for, run_policy
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.tasks import WipingTasks

QUESTION = (
    "The policy wipes boards it has never seen: does the tool press gently, and does contact safety cost any ink?"
)
SCENARIO = "wiping"
_TOUCHING_N = 0.5  # pad force above which a tick counts as contact
_LANDING_TICKS = 200  # after the first of them
_Z = 2


def task_safety(bundle, config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment; the board with the most ink is recorded.

    Args:
        bundle: loaded `Bundle`.
        config: controllers and seeds.
        progress: told of every trial done.
    """
    trials: list[Trial] = []
    recordings: list[Recording] = []
    fullest: Recording | None
    for name in config.controllers:
        most, fullest = 0, None  # ink, recording
        for seeds in config.batches():
            tasks = WipingTasks(WipingConfig(controller=name), len(seeds), list(seeds))
            for i, seed in enumerate(seeds):
                tasks.reset(i, held_out(seed))
            ink = tasks.tasks["ink_start"].copy()
            policy = policy_for(bundle, tasks)
            run = run_policy(tasks, policy.act, tasks.step_limit, stop_when_clean=True)
            for i, seed in enumerate(seeds):
                trials.append(Trial(SCENARIO, name, seed, wiping_metrics(run.traces[i], run.clean[i])))
            i = int(np.argmax(ink))
            if ink[i] > most:  # all controllers get the same boards, so it is the same one of each
                most, fullest = ink[i], run.recording(i, SCENARIO, name, seeds[i])
            tasks.worlds.close()
            if progress:
                progress(len(seeds))
        if fullest is not None:
            recordings.append(fullest)
    return Experiment("task-safety", QUESTION, tuple(trials), tuple(recordings))


def wiping_metrics(trace: np.ndarray, clean: bool) -> dict[str, float]:
    """Summarise one episode of wiping.

    Args:
        trace: `trace_dtype` records, (T,).
        clean: whether the board ended clean.
    """
    force = np.linalg.norm(trace["tool_force"], axis=1)
    touching = force > _TOUCHING_N
    return {
        "ink_removed": float(1.0 - trace["ink_left"][-1]),
        "clean": float(clean),
        "time_s": float(trace["time"][-1]) if clean else float("nan"),
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


def landing_peak(force: np.ndarray, touching: np.ndarray) -> float:
    """Give the largest force within 0.2 s of the first touch, N; NaN where nothing was touched.

    Args:
        force: of the board on the tool, tick by tick, (T,), N.
        touching: which ticks count as contact, (T,).
    """
    if not touching.any():
        return float("nan")
    first = int(np.argmax(touching))
    return float(force[first : first + _LANDING_TICKS].max())


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")
