"""Collisions nobody chose: random motions meet random obstacles anywhere along the arm; how hard, and how long?"""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from contactsafe.control import presets
from contactsafe.control.codes import COMPLY, FREE, REJECT
from contactsafe.control.config import ControllerConfig
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.collision_scenes import Meeting, Motion, sample_meetings, sample_motion
from contactsafe.experiments.config import BATCH, PLANTS, ExperimentConfig
from contactsafe.experiments.motions import record
from contactsafe.experiments.results import Experiment, Recording, Trial
from contactsafe.experiments.run import Progress
from contactsafe.experiments.verdict import verdict_table, worst_tables
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm
from contactsafe.sim.world import Worlds

QUESTION = (
    "The tool sweeps or holds, wiping or in free air, and a random point of the arm meets something soft or stiff: "
    "how hard is the contact, and for how long?"
)
STEADY_S = 0.5
"""The last part of a trial, over which steady figures are means, s."""

CONTACT_N = 0.5
"""Obstacle force that counts as contact, N."""

_AT_LIMIT_RAD = 1e-3
_FIXED_N_M = 1e6  # what stands for the stiffness of an obstacle that cannot move


def collisions(bundle, config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the battery; it needs no policy.

    Args:
        bundle: not used.
        config: controllers, seeds and plants.
        progress: told of every trial done.
    """
    controllers = {name: presets.by_name(name) for name in config.controllers}
    return run_battery(controllers, config.seeds, config.plants, progress)


def run_battery(
    controllers: Mapping[str, ControllerConfig],
    seeds: Sequence[int],
    plants: Sequence[str] = PLANTS,
    progress: Progress | None = None,
) -> Experiment:
    """Put controllers through the same collisions. What becomes of a seed does not depend on the others.

    Args:
        controllers: configurations by name; they are compared with 'vices' where it is among them, else with the first.
        seeds: one a scene: of motion, plant, obstacles and noise.
        plants: some of `PLANTS`.
        progress: told how many trials were just done.

    Returns:
        A trial for each seed, plant and controller, recordings of the first seed, tables of verdicts and worst trials.

    Raises:
        InvalidInputError: no controller, no seed, or a plant that is not one of `PLANTS`.
    """
    if not controllers or not seeds or not plants or not set(plants) <= set(PLANTS):
        raise InvalidInputError(
            f"{len(controllers)} controllers, {len(seeds)} seeds, plants {', '.join(plants)}; "
            f"give one or more of each, plants from {', '.join(PLANTS)}"
        )
    arm = robots.panda()
    batches = [seeds[start : start + BATCH] for start in range(0, len(seeds), BATCH)]
    # Each batch steps in native threads; several at a time, so that one steps while another is being set up.
    pool = ThreadPoolExecutor(os.cpu_count())
    try:
        done = list(
            pool.map(
                lambda batch: _run_batch(arm, batch, controllers, plants, progress, recorded=batch is batches[0]),
                batches,
            )
        )
    finally:
        pool.shutdown(cancel_futures=True)
    trials = tuple(trial for of_batch, _ in done for trial in of_batch)
    tables = (verdict_table(trials), *worst_tables(trials, _replay(controllers, plants)))
    return Experiment("collisions", QUESTION, trials, tuple(done[0][1]), tables)


def _run_batch(
    arm: Arm,
    seeds: Sequence[int],
    controllers: Mapping[str, ControllerConfig],
    plants: Sequence[str],
    progress: Progress | None,
    recorded: bool,
) -> tuple[list[Trial], list[Recording]]:
    """Give the trials of some seeds, and recordings of the first of them where wanted."""
    batch = _Batch(arm, seeds)
    trials: list[Trial] = []
    recordings: list[Recording] = []
    for plant in plants:
        for name, traces in batch.run(controllers, plant):
            trials += batch.trials(name, plant, traces)
            if recorded:
                recordings.append(batch.recording(name, plant, traces))
            if progress:
                progress(len(traces))
    return trials, recordings


def _replay(controllers: Mapping[str, ControllerConfig], plants: Sequence[str]) -> str:
    """Say how one seed is run again, with {seed} in its place."""
    if all(name in presets.PRESETS and presets.by_name(name) == config for name, config in controllers.items()):
        names = "" if tuple(controllers) == ExperimentConfig.controllers else f" --controllers {','.join(controllers)}"
        names += "" if tuple(plants) == PLANTS else f" --plants {','.join(plants)}"
        return f"contactsafe experiment collisions{names} --trials 1 --out trial-{{seed}} --seed {{seed}}"
    return "run_battery(controllers, [{seed}])"


class _Batch:
    """Scenes stepped side by side.

    Args:
        arm: built from a description.
        seeds: of the scenes.
    """

    def __init__(self, arm: Arm, seeds: Sequence[int]):
        self.arm, self.seeds = arm, seeds
        self.motions = [sample_motion(arm, seed) for seed in seeds]
        nothing: list[tuple[Meeting, ...]] = [()] * len(seeds)
        worlds = self._worlds(nothing, presets.vices(), "real")
        self.free = record(worlds, self.motions)
        worlds.close()
        self.meetings = [
            sample_meetings(arm, motion, trace["q"]) for motion, trace in zip(self.motions, self.free, strict=True)
        ]

    def run(self, controllers: Mapping[str, ControllerConfig], plant: str):
        """Yield each controller's name and its traces, one a scene."""
        worlds = self._worlds(self.meetings, None, plant)
        for name, controller in controllers.items():
            worlds.use(controller)
            worlds.seed(self.seeds)
            yield name, record(worlds, self.motions)
        worlds.close()

    def trials(self, controller: str, plant: str, traces: Sequence[np.ndarray]) -> list[Trial]:
        """Summarise what one controller did."""
        return [
            Trial(
                describe(motion),
                controller,
                motion.seed,
                collision_metrics(trace, free, self.arm) | scene_metrics(motion, meetings),
                plant,
            )
            for motion, meetings, trace, free in zip(self.motions, self.meetings, traces, self.free, strict=True)
        ]

    def recording(self, controller: str, plant: str, traces: Sequence[np.ndarray]) -> Recording:
        """Give the first scene as a recording, its error the tool's departure from the free motion."""
        trace = traces[0].copy()
        trace["error"][:, :3] = self.free[0]["position"] - trace["position"]
        heading = Trial(describe(self.motions[0]), controller, self.seeds[0], {}, plant).heading
        return Recording(heading, controller, self.seeds[0], trace, np.zeros((1, 1, 1), np.uint8), len(trace))

    def _worlds(self, meetings, controller: ControllerConfig | None, plant: str) -> Worlds:
        configs = [
            motion.world(tuple(meeting.obstacle for meeting in met), plant == "real")
            for motion, met in zip(self.motions, meetings, strict=True)
        ]
        return Worlds(self.arm, configs, controller, len(configs), self.seeds)


def describe(motion: Motion) -> str:
    """Say in words what the tool was doing."""
    return f"{'hold' if motion.holds else 'sweep'} {'wiping' if motion.wiping else 'in free air'}"


def scene_metrics(motion: Motion, meetings: tuple[Meeting, ...]) -> dict[str, float]:
    """Describe a trial's scene by numbers; of two obstacles the stiffer one."""
    stiffest = max(meetings, key=lambda meeting: meeting.obstacle.stiffness)
    return {
        "obstacles": float(len(meetings)),
        "link": float(stiffest.link),
        "obstacle_stiffness_n_m": _FIXED_N_M if stiffest.obstacle.fixed else stiffest.obstacle.stiffness,
        "obstacle_mass_kg": stiffest.obstacle.mass,
        "speed_m_s": 0.0 if motion.holds else motion.speed_m_s,
        "lead_limited": float(motion.limited),
    }


def collision_metrics(trace: np.ndarray, free: np.ndarray, arm: Arm) -> dict[str, float]:
    """Summarise one collision by the simulator's truth.

    Args:
        trace: `trace_dtype` records, (T,).
        free: the same motion with nothing in the way, (T,).
        arm: for its joint range.
    """
    force = trace["obstacle_force"]
    touching = force > CONTACT_N
    steady = trace["time"] > trace["time"][-1] - STEADY_S
    tau = np.abs(trace["tau_arm"]).max(axis=1)
    away = np.linalg.norm(trace["position"] - free["position"], axis=1)
    at_limit = ((trace["q"] < arm.q_min + _AT_LIMIT_RAD) | (trace["q"] > arm.q_max - _AT_LIMIT_RAD)).any(axis=1)
    first = int(np.argmax(touching))
    found = trace["link"][first:] > 0
    return {
        "met": float(touching.any()),
        "contact_peak_n": float(force.max()),
        "contact_steady_n": float(force[steady].mean()),
        "impulse_ns": float(force.sum() / 1000.0),
        "tau_peak_nm": float(tau.max()),
        "tau_steady_nm": float(tau[steady].mean()),
        "detect_ms": float(np.argmax(found)) if touching.any() and found.any() else float("nan"),
        "tool_error_mm": float(1000.0 * away.max()),
        "tool_error_end_mm": float(1000.0 * away[-1]),
        "tool_force_peak_n": float(np.linalg.norm(trace["tool_force"], axis=1).max()),
        "comply_fraction": float((trace["mode"] == COMPLY).mean()),
        "reject_fraction": float((trace["mode"] == REJECT).mean()),
        "mode_switches": float(np.count_nonzero(np.diff(trace["mode"] != FREE))),
        "limit_touches": float(np.count_nonzero(np.diff(at_limit.astype(int)) > 0)),
    }
