"""The experiments by name: what runs each, how many seeds it wants, how many trials that makes."""

from collections.abc import Callable
from dataclasses import dataclass

from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments import clock, collisions, detection, disturbance, hostile, joint_safety, task_safety
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.results import Experiment


@dataclass(frozen=True)
class Entry:
    """One experiment.

    Attributes:
        run: called with bundle, config and progress.
        count: how many trials of all controllers a configuration comes to.
        trials: seeds tried where nobody says how many.
        needs_policy: whether it runs a policy bundle.
    """

    run: Callable[..., Experiment]
    count: Callable[[ExperimentConfig], int]
    trials: int = 10
    needs_policy: bool = False


PAPER = ("task-safety", "joint-safety", "disturbance")
"""The paper's own experiments, which the demo runs."""

ENTRIES = {
    "task-safety": Entry(task_safety.task_safety, lambda config: _count(config, 1), needs_policy=True),
    "joint-safety": Entry(
        joint_safety.joint_safety, lambda config: _count(config, len(joint_safety.OBSTACLES)), needs_policy=True
    ),
    "disturbance": Entry(
        disturbance.disturbance, lambda config: _count(config, len(disturbance.MODES) * len(disturbance.PUSH_POINTS))
    ),
    "collisions": Entry(collisions.collisions, lambda config: _count(config, len(config.plants)), trials=100),
    "detection": Entry(detection.detection, detection.count, trials=100),
    "hostile": Entry(hostile.hostile, lambda config: _count(config, 1), trials=100),
    "clock": Entry(clock.clock, clock.count, trials=5),
}


def _count(config: ExperimentConfig, scenarios: int) -> int:
    return config.trials * len(config.controllers) * scenarios


def by_name(name: str) -> Entry:
    """Look an experiment up by its name.

    Raises:
        InvalidInputError: no such experiment.
    """
    if name not in ENTRIES:
        raise InvalidInputError(f"experiment '{name}' is unknown; choose from {', '.join(ENTRIES)}")
    return ENTRIES[name]
