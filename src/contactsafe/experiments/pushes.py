"""Pushes as people give them: on any point of the arm, from any side, sudden or slow: how far does the tool stray?"""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from contactsafe.control import presets
from contactsafe.control.config import ControllerConfig
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.again import run_again
from contactsafe.experiments.config import BATCH, Entry, ExperimentConfig, Progress
from contactsafe.experiments.motions import Playback, record_rest
from contactsafe.experiments.push_metrics import METRICS, against, push_metrics
from contactsafe.experiments.push_scenes import PushedMotion, sample_pushed_motion
from contactsafe.experiments.push_tables import push_tables
from contactsafe.experiments.sensors import USUAL, require_sensors, sensors_words
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.figures import Figure, Panel, length, scalar
from contactsafe.results.metrics import BASELINE
from contactsafe.results.recording import Recording
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm, require_arm
from contactsafe.sim.config import SENSORS, SensorConfig, WorldConfig
from contactsafe.sim.worlds import Worlds

NAME = "pushes"
QUESTION = (
    "Somebody pushes a random point of the arm with 8 to 30 N for 1.5 s, along its normal, obliquely or sideways, "
    "within 0.02 to 1 s, while the tool holds or moves: how far is the tool displaced, and does it come back?"
)
WITH_WRENCH, WITHOUT = "with wrench", "without wrench"
"""Whether a force sensor at the wrist tells the controller that nothing touches the tool."""

CURVES = Figure(
    plots=(
        (
            Panel("tool away from its run without the push", "mm", length("error", 1000.0)),
            Panel("mode: 0 free, 1 comply, 2 reject", "", scalar("mode")),
            Panel("torque of the push, joint by joint", "N m", lambda run: run.trace["tau_arm"]),
        ),
    ),
    caption="Displacement of the tool, the controller's mode, and what the push puts on the joints.",
)


def pushes(config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the battery; it needs no policy.

    Args:
        config: controllers, arm and seeds.
        progress: told of every trial done.
    """
    controllers = {name: presets.by_name(name) for name in config.controllers}
    return run_pushes(controllers, config.seeds, progress, config.arm, config.arm_words, config.sensors)


ENTRY = Entry(
    NAME,
    "somebody pushes the arm, anywhere and from any side.",
    pushes,
    count=lambda config: config.count(2),
    trials=100,
    takes=("sensors",),
)


def run_pushes(
    controllers: Mapping[str, ControllerConfig],
    seeds: Sequence[int],
    progress: Progress | None = None,
    arm: Arm | None = None,
    arm_words: Sequence[str] | None = None,
    sensors: str = USUAL,
) -> Experiment:
    """Give controllers the same pushes. A seed's trial does not depend on the others.

    Args:
        controllers: configurations by name; they are compared with 'vices' where it is among them, else with the first.
        seeds: one a scene: of motion, plant, push and noise.
        progress: told how many trials were just done.
        arm: that is pushed; None for a Panda.
        arm_words: what names it on the command line; None where nothing does.
        sensors: of the arm, one of `SENSORS`.

    Returns:
        Two trials for each seed and controller, with and without the wrist's wrench; recordings of the first seed;
        tables of the comparison.

    Raises:
        InvalidInputError: no controller, or no seed.
    """
    if not controllers or not seeds:
        raise InvalidInputError(f"{len(controllers)} controllers, {len(seeds)} seeds; give one or more of each")
    known = SENSORS[require_sensors(sensors)]
    usual = robots.panda()
    arm = usual if arm is None else require_arm(arm)
    batches = [seeds[start : start + BATCH] for start in range(0, len(seeds), BATCH)]
    pool = ThreadPoolExecutor(os.cpu_count())
    try:
        done = list(
            pool.map(lambda batch: _run_batch(arm, batch, controllers, known, progress, batch is batches[0]), batches)
        )
    finally:
        pool.shutdown(cancel_futures=True)
    baseline = BASELINE if BASELINE in controllers else next(iter(controllers))
    trials = compared([trial for of_batch, _ in done for trial in of_batch], baseline)
    words = [NAME, "--controllers", ",".join(controllers), *sensors_words(sensors)]
    again = run_again("run_pushes", words, controllers, (arm, usual), arm_words)
    return Experiment(
        NAME, "Pushes", QUESTION, trials, METRICS, recordings=tuple(done[0][1]), figures=(CURVES,),
        tables=push_tables(trials, baseline, again),
    )  # fmt: skip


def _run_batch(
    arm: Arm,
    seeds: Sequence[int],
    controllers: Mapping[str, ControllerConfig],
    sensors: SensorConfig,
    progress: Progress | None,
    recorded: bool,
) -> tuple[list[Trial], list[Recording]]:
    """Return the trials of some seeds, and recordings of the first of them where wanted."""
    scenes = [sample_pushed_motion(arm, seed) for seed in seeds]
    trials: list[Trial] = []
    recordings: list[Recording] = []
    for scenario in (WITH_WRENCH, WITHOUT):
        of_scenario = replace(sensors, wrist=scenario == WITH_WRENCH)
        worlds = Worlds(
            arm, [WorldConfig(scene.plant, of_scenario, fixtures=()) for scene in scenes], None, len(scenes), seeds
        )
        for name, controller in controllers.items():
            worlds.use(controller)
            calm, pushed = (run_pushed(worlds, scenes, with_push) for with_push in (False, True))
            trials += [
                Trial(scenario, name, scene.seed, push_metrics(trace, of_calm, scene))
                for scene, trace, of_calm in zip(scenes, pushed, calm, strict=True)
            ]
            if recorded:
                trace = pushed[0].copy()
                trace["error"][:, :3] = calm[0]["position"] - trace["position"]
                recordings.append(Recording(scenario, name, seeds[0], trace))
            if progress:
                progress(len(scenes))
        worlds.close()
    return trials, recordings


def run_pushed(worlds: Worlds, scenes: Sequence[PushedMotion], with_push: bool) -> list[np.ndarray]:
    """Play scenes in their worlds, from the beginning, with their noise, and with their push or without.

    Returns:
        One array of `trace_dtype` records for each, one a ms.
    """
    worlds.seed([scene.seed for scene in scenes])
    play = Playback(worlds, scenes)
    if with_push:
        for i, scene in enumerate(scenes):
            worlds.push(i, f"link{scene.link}", scene.point, scene.force, scene.meets_s, scene.release_s, scene.ramp_s)
    return record_rest(play)


def compared(trials: Sequence[Trial], baseline: str) -> tuple[Trial, ...]:
    """Add to each trial how its displacement compares with the baseline's in the same trial; see `against`."""
    before = {(t.scenario, t.seed): t.metrics for t in trials if t.controller == baseline}
    return tuple(replace(t, metrics=t.metrics | against(t.metrics, before[t.scenario, t.seed])) for t in trials)
