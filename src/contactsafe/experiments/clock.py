"""Clocks: measurements late, lost, frozen, repeated or impossible, another rate, a late policy: what then?"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contactsafe.control import presets
from contactsafe.control.codes import FREE
from contactsafe.control.config import ControllerConfig
from contactsafe.control.controller import Controller
from contactsafe.experiments.clock_cases import CASES, SITUATIONS, Case, Scene, heading, sample_scene
from contactsafe.experiments.clock_tables import clock_tables
from contactsafe.experiments.collision_motions import scene_rng
from contactsafe.experiments.config import Entry, ExperimentConfig, Progress
from contactsafe.experiments.late_worlds import SEEN, LatePlayback, LateWorlds
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.metrics import CONTACT_N, ZERO, Aim, Metric
from contactsafe.robot.arm import Arm
from contactsafe.sim.config import REAL_SENSORS
from contactsafe.sim.worlds import MAX_TICKS

NAME = "clock"
QUESTION = (
    "Ticks come late, measurements are lost, frozen, repeated or impossible, the rate is another, the policy falls "
    "silent: is a contact reported that is none, does the torque jump, does the tool stray, and is it said?"
)
METRICS = (
    Metric("false_contact_ms", "contact reported that is none", "ms", aim=ZERO),
    Metric("torque_step_nm", "torque step, largest", "N m", aim=Aim(at_most=1.0, always=True)),
    Metric("tool_away_mm", "tool away from the undisturbed run", "mm", aim=Aim(at_most=2.0, always=True)),
    Metric("tool_travel_mm", "path of the tool until it rests", "mm"),
    Metric("joint_speed_left_rad_s", "joint speed in the end", "rad/s"),
    Metric("torque_step_back_nm", "torque step on reset, largest", "N m", aim=Aim(at_most=1.0, always=True)),
    Metric("contact_peak_n", "contact force, peak", "N"),
    Metric("contact_peak_calm_n", "contact force undisturbed, peak", "N"),
)
AFTER_S = 1.2
"""How long a trial goes on after its disturbance began, s."""

_BACK_TICKS = 500  # after the reset that ends a trial


def clock(config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment; it needs no policy.

    Args:
        config: controllers, arm and seeds.
        progress: told of every trial done.
    """
    arm = config.arm
    scenes = {situation: [sample_scene(arm, situation, seed) for seed in config.seeds] for situation in SITUATIONS}
    trials: list[Trial] = []
    for name in config.controllers:
        controller = presets.by_name(name)
        for situation, of_situation in scenes.items():
            calm, _ = _run(arm, controller, of_situation, None, False)
            for case, timed in itertools.product(CASES, (False, True)):
                traces, endings = _run(arm, controller, of_situation, case, timed)
                for scene, trace, still, ending in zip(of_situation, traces, calm, endings, strict=True):
                    metrics = clock_metrics(trace, still, scene, case) | ending.metrics()
                    trials.append(Trial(heading(case, timed, situation), name, scene.seed, metrics))
                if progress:
                    progress(len(endings))
    tables = tuple(clock_tables(trials, config.controllers, CASES))
    return Experiment(NAME, "Clocks", QUESTION, tuple(trials), METRICS, tables=tables)


def count(config: ExperimentConfig) -> int:
    """Count the trials of a configuration."""
    return config.count(len(SITUATIONS) * len(CASES) * 2)


ENTRY = Entry(NAME, "ticks late, measurements lost, frozen or impossible, no policy.", clock, count=count, trials=5)


@dataclass(frozen=True)
class _Ending:
    """How a trial was left: fault, largest joint speed in rad/s, and largest torque step in N m while it was reset."""

    fault: int
    joint_speed: float
    step_back: float

    def metrics(self) -> dict[str, float]:
        return {
            "fault": float(self.fault),
            "joint_speed_left_rad_s": self.joint_speed,
            "torque_step_back_nm": self.step_back,
        }


def _run(
    arm: Arm, controller: ControllerConfig, scenes: Sequence[Scene], case: Case | None, timed: bool
) -> tuple[np.ndarray, list[_Ending]]:
    """Run scenes side by side, nothing disturbed without a case, and reset their controllers in the end.

    Returns:
        `trace_dtype` records, (n, ticks), and how each was left.
    """
    ticks = max(scene.at for scene in scenes) + round(1000 * AFTER_S)
    codes = np.full((len(scenes), ticks + MAX_TICKS + _BACK_TICKS), SEEN)
    if case is not None:
        for row, scene in zip(codes, scenes, strict=True):
            row[:ticks] = case.codes(ticks, scene.at, scene_rng(scene.seed, 3))
    silent = [(scene.at, scene.at + round(1000 * case.silent_s) if case else 0) for scene in scenes]
    configs = [scene.motion.world(scene.obstacles, REAL_SENSORS) for scene in scenes]
    worlds = LateWorlds(arm, configs, controller, [scene.seed for scene in scenes], codes, timed)
    trace = LatePlayback(worlds, [scene.motion for scene in scenes], ticks, silent).record()
    faults = worlds.controllers["state"]["fault"].tolist()
    speeds = [float(np.abs(data.qvel[: arm.n]).max()) for data in worlds.datas]
    steps = _reset(worlds, controller)
    worlds.close()
    return trace, [_Ending(*found) for found in zip(faults, speeds, steps, strict=True)]


def _reset(worlds: LateWorlds, controller: ControllerConfig) -> list[float]:
    """Reset all controllers where their arms are; return the largest torque step of each from then on, N m."""
    torques = [worlds.controllers["output"]["torque"].copy()]
    arm = worlds.arm
    owners = [Controller(arm, controller, worlds.controllers, i) for i in range(worlds.n)]
    for owner, data, sent in zip(owners, worlds.datas, torques[0], strict=True):
        owner.reset(np.clip(data.qpos[: arm.n], arm.q_min, arm.q_max), data.qvel[: arm.n], sent)
    for _ in range(_BACK_TICKS):
        worlds.run(1)
        torques.append(worlds.controllers["output"]["torque"].copy())
    return np.abs(np.diff(torques, axis=0)).max(axis=(0, 2)).tolist()


def clock_metrics(trace: np.ndarray, calm: np.ndarray, scene: Scene, case: Case) -> dict[str, float]:
    """Compare a trial with the same one undisturbed.

    Args:
        trace, calm: `trace_dtype` records, (T,).
        scene: what the arm was doing.
        case: what happened; whatever strays that is braked or not led any more, its deviation does not exist (NaN).
    """
    away = np.linalg.norm(trace["position"] - calm["position"], axis=1)
    after = trace["position"][scene.at :]
    led = not case.stops and case.silent_s == 0.0
    touched = bool(scene.obstacles)
    return {
        "false_contact_ms": np.nan
        if touched
        else float(np.count_nonzero((trace["mode"] != FREE) & (calm["mode"] == FREE))),
        "torque_step_nm": float(np.abs(np.diff(trace["torque"], axis=0)).max()),
        "tool_away_mm": float(1000.0 * away.max()) if led else np.nan,
        "tool_travel_mm": np.nan if led else float(1000.0 * np.linalg.norm(after - after[0], axis=1).max()),
        "contact_peak_n": float(trace["obstacle_force"][scene.at :].max()) if touched else np.nan,
        "contact_peak_calm_n": float(calm["obstacle_force"][scene.at :].max()) if touched else np.nan,
        "touching": float(calm["obstacle_force"][scene.at] > CONTACT_N) if touched else np.nan,
    }
