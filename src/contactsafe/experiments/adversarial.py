"""Adversarial targets: random, extreme, jumping and unusable targets; does the arm keep every limit it promises?"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from contactsafe.control import presets
from contactsafe.control.config import ControllerConfig
from contactsafe.core.rotation import rotvec_to_quat
from contactsafe.experiments.collision_motions import sample_plant, scene_rng
from contactsafe.experiments.collision_scenes import sample_obstacle
from contactsafe.experiments.config import Entry, ExperimentConfig, Progress
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.metrics import ZERO, Aim, Metric
from contactsafe.robot.arm import Arm
from contactsafe.sim.config import REAL_SENSORS, SensorConfig, WorldConfig
from contactsafe.sim.obstacles import Obstacle
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds

NAME = "adversarial"
QUESTION = (
    "Targets are random, extreme, jump, and hold numbers that are not finite, among obstacles: are torque, "
    "torque rate and joint range kept, and how much energy does the arm give away?"
)
METRICS = (
    Metric("not_finite", "torques that are not finite", main=True, aim=ZERO),
    Metric("torque_violations", "torques beyond the limit", main=True, aim=ZERO),
    Metric("torque_rate_violations", "steps beyond the rate limit", main=True, aim=ZERO),
    Metric("joint_range_violations", "ms outside the joint range", main=True, aim=ZERO),
    Metric("joint_range_beyond_mrad", "largest excursion from the joint range", "mrad"),
    Metric("energy_given_j", "energy given to the world", "J", main=True),
    Metric(
        "energy_most_of_bound", "energy given, fraction of the bound", "%", 100.0, main=True,
        aim=Aim(at_most=100.0, always=True),
    ),
    Metric("contact_peak_n", "contact force, peak", "N", main=True),
)  # fmt: skip

TICKS = 10_000
"""Of one trial; 100 trials are a million."""

_RATE_TOLERANCE_NM = 1e-9
_THINGS = 3


def adversarial(config: ExperimentConfig, progress: Progress | None = None) -> Experiment:
    """Run the experiment; it needs no policy.

    Args:
        config: controllers, arm and seeds; each trial is `TICKS` long.
        progress: told of every trial done.
    """
    arm = config.arm
    trials: list[Trial] = []
    for name in config.controllers:
        for seeds in config.batches():
            metrics = run_adversarial(arm, presets.by_name(name), seeds, sensors=config.real_sensors)
            trials += [Trial("adversarial targets", name, seed, row) for seed, row in zip(seeds, metrics, strict=True)]
            if progress:
                progress(len(seeds))
    return Experiment(NAME, "Adversarial targets", QUESTION, tuple(trials), METRICS)


ENTRY = Entry(
    NAME, "targets that ask for the impossible: are all limits kept?", adversarial, trials=100, takes=("sensors",)
)


def run_adversarial(
    arm: Arm,
    controller: ControllerConfig,
    seeds: Sequence[int],
    ticks: int = TICKS,
    sensors: SensorConfig = REAL_SENSORS,
) -> list[dict[str, float]]:
    """Drive one arm for each seed by adversarial targets.

    Returns:
        For each, its metrics; see `limit_metrics`.
    """
    rngs = [scene_rng(seed, 2) for seed in seeds]
    worlds = Worlds(arm, [_world(arm, rng, sensors) for rng in rngs], controller, len(seeds), list(seeds))
    for i in range(len(seeds)):
        worlds.reset(i, arm.home)
    trace = np.zeros((len(seeds), MAX_TICKS), dtype=trace_dtype(arm.n))
    pieces: list[np.ndarray] = []
    while MAX_TICKS * len(pieces) < ticks:
        for i, rng in enumerate(rngs):
            if rng.random() < 0.2:
                corrupt_target(worlds.controllers[i]["target"], arm, rng)
        worlds.run(MAX_TICKS, trace)
        pieces.append(trace.copy())
    worlds.close()
    traces = np.concatenate(pieces, axis=1)
    return [limit_metrics(traces[i], arm, controller) for i in range(len(seeds))]


def _world(arm: Arm, rng: np.random.Generator, sensors: SensorConfig) -> WorldConfig:
    things = tuple(_thing(rng) for _ in range(_THINGS))
    return WorldConfig(plant=sample_plant(rng, arm.n), sensors=sensors, obstacles=things)


def _thing(rng: np.random.Generator) -> Obstacle:
    """Sample something in the arm's reach, clear of where it stands at first."""
    angle, distance = rng.uniform(0.5, 2 * np.pi - 0.5), rng.uniform(0.35, 0.6)
    position = (float(distance * np.cos(angle)), float(distance * np.sin(angle)), float(rng.uniform(0.2, 0.8)))
    return replace(sample_obstacle(rng, rng.uniform(0.03, 0.08), may_be_fixed=True), position=position)


def corrupt_target(target: np.ndarray, arm: Arm, rng: np.random.Generator) -> None:
    """Write an adversarial target into a `target_dtype` record."""
    scale = 10.0 ** rng.uniform(-2, 3)
    target["position"] = np.array([0.4, 0.0, 0.4]) + scale * rng.standard_normal(3)
    target["quat"] = rotvec_to_quat(rng.uniform(-np.pi, np.pi, 3))
    target["K_task"] = rng.choice([10.0, 1500.0, rng.uniform(10, 1500)], 6)
    target["D_task"] = rng.choice([2.0, 120.0, rng.uniform(2, 120)], 6)
    target["q_posture"] = rng.uniform(4 * arm.q_min, 4 * arm.q_max)
    if rng.random() < 0.3:
        field = rng.choice(["position", "quat", "K_task", "D_task", "q_posture"])
        target[field][rng.integers(target[field].shape[0])] = rng.choice([np.nan, np.inf, -np.inf, 1e300, -5.0, 0.0])


def limit_metrics(trace: np.ndarray, arm: Arm, controller: ControllerConfig) -> dict[str, float]:
    """Count violations of limits, and compare the energy that it gave away with what the tank allows.

    Args:
        trace: `trace_dtype` records, one a ms, from rest, (T,).
        arm: for its limits.
        controller: its configuration, for the tank.
    """
    torque, q = trace["torque"], trace["q"]
    steps = np.abs(np.diff(torque, axis=0))
    given = -np.cumsum(np.einsum("ti,ti->t", trace["tau_arm"][:-1], np.diff(q, axis=0)))
    allowed = controller.limits.tank_j + controller.limits.tank_power_w * trace["time"][1:]
    beyond = np.maximum(arm.q_min - q, q - arm.q_max)
    return {
        "not_finite": float(np.count_nonzero(~np.isfinite(torque))),
        "torque_violations": float(np.count_nonzero(np.abs(torque) > arm.tau_max)),
        "torque_rate_violations": float(np.count_nonzero(steps > arm.torque_rate_max * 0.001 + _RATE_TOLERANCE_NM)),
        "joint_range_violations": float(np.count_nonzero((beyond > 0.0).any(axis=1))),
        "joint_range_beyond_mrad": float(max(1000.0 * beyond.max(), 0.0)),
        "energy_given_j": float(given[-1]),
        "energy_most_of_bound": float((given / allowed).max()),
        "contact_peak_n": float(trace["obstacle_force"].max()),
        "seconds": float(len(trace) / 1000.0),
    }
