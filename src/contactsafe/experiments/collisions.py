"""Collisions nobody chose: random motions meet random obstacles anywhere along the arm: which forces, for how long?"""

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from contactsafe.control import presets
from contactsafe.control.config import ControllerConfig
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.again import run_again
from contactsafe.experiments.collision_metrics import METRICS, collision_metrics, describe, scene_metrics
from contactsafe.experiments.collision_motions import sample_motion
from contactsafe.experiments.collision_scenes import Meeting, sample_meetings
from contactsafe.experiments.config import (
    BATCH,
    PLANTS,
    Entry,
    ExperimentConfig,
    Progress,
)
from contactsafe.experiments.motions import record
from contactsafe.experiments.sensors import USUAL, require_sensors, sensors_words
from contactsafe.experiments.verdict_tables import verdict_table, worst_tables
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.figures import Figure, Panel, length, scalar
from contactsafe.results.recording import Recording
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm, require_arm
from contactsafe.sim.config import SENSORS, SensorConfig
from contactsafe.sim.worlds import Worlds

NAME = "collisions"
QUESTION = (
    "The tool sweeps or holds, sliding on a surface or in free air, and a random point of the arm meets something soft "
    "or stiff: what are the contact forces, and for how long?"
)
CURVES = Figure(
    plots=(
        (
            Panel("contact force", "N", scalar("obstacle_force")),
            Panel("mode: 0 free, 1 comply, 2 reject", "", lambda run: run.trace["mode"]),
            Panel("tool away from its free motion", "mm", length("error", 1000.0)),
        ),
    ),
    caption="Force of the obstacle on the arm, of two the larger; the controller's mode; the tool.",
)


def collisions(config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the battery; it needs no policy.

    Args:
        config: controllers, arm, seeds and plants.
        progress: told of every trial done.
    """
    controllers = {name: presets.by_name(name) for name in config.controllers}
    return run_battery(controllers, config.seeds, config.plants, progress, config.arm, config.arm_words, config.sensors)


ENTRY = Entry(
    NAME,
    "random motions meet random obstacles anywhere on the arm.",
    collisions,
    count=lambda config: config.count(len(config.plants)),
    trials=100,
    takes=("plants", "sensors"),
)


def run_battery(
    controllers: Mapping[str, ControllerConfig],
    seeds: Sequence[int],
    plants: Sequence[str] = PLANTS,
    progress: Progress | None = None,
    arm: Arm | None = None,
    arm_words: Sequence[str] | None = None,
    sensors: str = USUAL,
) -> Experiment:
    """Put controllers through the same collisions. A seed's trial does not depend on the others.

    Args:
        controllers: configurations by name; they are compared with 'vices' where it is among them, else with the first.
        seeds: one a scene: of motion, plant, obstacles and noise.
        plants: some of `PLANTS`.
        progress: told how many trials were just done.
        arm: that collides; None for a Panda.
        arm_words: what names it on the command line; None where nothing does.
        sensors: of the real plant, one of `SENSORS`.

    Returns:
        A trial for each seed, plant and controller, recordings of the first seed, tables of the comparison and of the
        worst trials.

    Raises:
        InvalidInputError: no controller, no seed, or a plant that is not one of `PLANTS`.
    """
    if not controllers or not seeds or not plants or not set(plants) <= set(PLANTS):
        raise InvalidInputError(
            f"{len(controllers)} controllers, {len(seeds)} seeds, plants {', '.join(plants)}; "
            f"give one or more of each, plants from {', '.join(PLANTS)}"
        )
    known = SENSORS[require_sensors(sensors)]
    usual = robots.panda()
    arm = usual if arm is None else require_arm(arm)
    batches = [seeds[start : start + BATCH] for start in range(0, len(seeds), BATCH)]
    # Each batch steps in native threads; several at a time, so that one steps while another is being set up.
    pool = ThreadPoolExecutor(os.cpu_count())
    try:
        done = list(
            pool.map(
                lambda batch: _run_batch(arm, batch, controllers, plants, known, progress, batch is batches[0]),
                batches,
            )
        )
    finally:
        pool.shutdown(cancel_futures=True)
    trials = tuple(trial for of_batch, _ in done for trial in of_batch)
    again = run_again(
        "run_battery", [*_words(controllers, plants), *sensors_words(sensors)], controllers, (arm, usual), arm_words
    )
    tables = (verdict_table(trials), *worst_tables(trials, again))
    return Experiment(
        NAME, "Collisions", QUESTION, trials, METRICS, recordings=tuple(done[0][1]), figures=(CURVES,), tables=tables
    )


def _run_batch(
    arm: Arm,
    seeds: Sequence[int],
    controllers: Mapping[str, ControllerConfig],
    plants: Sequence[str],
    sensors: SensorConfig,
    progress: Progress | None,
    recorded: bool,
) -> tuple[list[Trial], list[Recording]]:
    """Return the trials of some seeds, and recordings of the first of them where wanted."""
    batch = _Batch(arm, seeds, sensors)
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


def _words(controllers: Mapping[str, ControllerConfig], plants: Sequence[str]) -> list[str]:
    """Return the words that ask for a battery, those that are not the default."""
    words = [] if tuple(controllers) == ExperimentConfig.controllers else ["--controllers", ",".join(controllers)]
    return [NAME, *words, *([] if tuple(plants) == PLANTS else ["--plants", ",".join(plants)])]


class _Batch:
    """Scenes stepped side by side.

    Args:
        arm: built from a description.
        seeds: of the scenes.
        sensors: of the real plant.
    """

    def __init__(self, arm: Arm, seeds: Sequence[int], sensors: SensorConfig):
        self.arm, self.seeds, self.sensors = arm, seeds, sensors
        self.motions = [sample_motion(arm, seed) for seed in seeds]
        nothing: list[tuple[Meeting, ...]] = [()] * len(seeds)
        worlds = self._worlds(nothing, presets.vices(), "real")
        self.free = record(worlds, self.motions)
        worlds.close()
        self.meetings = [
            sample_meetings(arm, motion, trace["q"]) for motion, trace in zip(self.motions, self.free, strict=True)
        ]

    def run(self, controllers: Mapping[str, ControllerConfig], plant: str) -> Iterator[tuple[str, list[np.ndarray]]]:
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
        """Return the first scene as a recording, its error the tool's departure from the free motion."""
        trace = traces[0].copy()
        trace["error"][:, :3] = self.free[0]["position"] - trace["position"]
        heading = Trial(describe(self.motions[0]), controller, self.seeds[0], {}, plant).heading
        return Recording(heading, controller, self.seeds[0], trace)

    def _worlds(
        self, meetings: Sequence[tuple[Meeting, ...]], controller: ControllerConfig | None, plant: str
    ) -> Worlds:
        configs = [
            motion.world(tuple(meeting.obstacle for meeting in met), self.sensors if plant == "real" else None)
            for motion, met in zip(self.motions, meetings, strict=True)
        ]
        return Worlds(self.arm, configs, controller, len(configs), self.seeds)
