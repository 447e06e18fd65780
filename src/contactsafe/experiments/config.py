"""What every experiment can be told, and how one is entered into the registry."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from contactsafe.control import presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.sensors import USUAL, require_sensors
from contactsafe.experiments.task import ExperimentTask
from contactsafe.policy.bundle import Bundle
from contactsafe.results.experiment import Experiment
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm, require_arm
from contactsafe.sim.config import SENSORS, SensorConfig

BATCH = 16
"""Most trials stepped together: bounds the memory that their traces take."""

PLANTS = ("real", "clean")
"""The arm and its sensors with errors sampled at random, or just as the controller's model has them."""

Progress = Callable[[int], object]
"""Told how many trials were just done."""

Taken = Literal["task", "bundle", "plants", "sensors", "minutes", "models"]
"""A field of `ExperimentConfig`, and an option of the command line, that not every experiment takes."""


@dataclass(frozen=True)
class ExperimentConfig:
    """Which controllers, how often, from which seed, and on what.

    Attributes:
        controllers: presets by name, in the order they are reported.
        trials: seeds tried, seed, seed + 1, …
        seed: first seed.
        plants: some of `PLANTS`, for collisions.
        sensors: of an arm that has errors, one of `SENSORS`: 19-bit encoders alone, or a Franka's torque sensors and
            its velocity with more noise.
        minutes: simulated time in which detection counts false alarms, min.
        models: of arms, for the experiment on them: PATH of an MJCF or URDF, or PATH:TOOL.
        task: for experiments that run one.
        bundle: policy, for experiments that run one.
        arm: that moves by a script, in experiments that run no task.
        arm_words: what names that arm on the command line; None where nothing does.
    """

    controllers: tuple[str, ...] = ("vices", "paper", "safe")
    trials: int = 10
    seed: int = 0
    plants: tuple[str, ...] = PLANTS
    sensors: str = USUAL
    minutes: float = 60.0
    models: tuple[str, ...] = ()
    task: ExperimentTask | None = None
    bundle: Bundle | None = None
    arm: Arm = field(default_factory=robots.panda)
    arm_words: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        """Refuse unknown controllers and empty experiments."""
        require_arm(self.arm)
        if not self.controllers:
            raise InvalidInputError(f"no controller given; choose from {', '.join(presets.PRESETS)}")
        for name in self.controllers:
            presets.by_name(name)
        if len(set(self.controllers)) < len(self.controllers):
            raise InvalidInputError(f"controllers = {','.join(self.controllers)}; give each once")
        if self.trials < 1:
            raise InvalidInputError(f"trials = {self.trials}; give 1 or more")
        if self.seed < 0:
            raise InvalidInputError(f"seed = {self.seed}; give 0 or more")
        if not self.plants or not set(self.plants) <= set(PLANTS):
            raise InvalidInputError(f"plants = {','.join(self.plants)}; choose from {', '.join(PLANTS)}")
        require_sensors(self.sensors)
        if not 0 < self.minutes < math.inf:
            raise InvalidInputError(f"minutes = {self.minutes:g}; give a number greater than 0")

    @property
    def real_sensors(self) -> SensorConfig:
        """What an arm that has errors is measured by."""
        return SENSORS[self.sensors]

    @property
    def seeds(self) -> range:
        """All seeds, in order."""
        return range(self.seed, self.seed + self.trials)

    def batches(self) -> list[range]:
        """Return the seeds in batches that are stepped together."""
        return [self.seeds[first : first + BATCH] for first in range(0, self.trials, BATCH)]

    def count(self, scenarios: int = 1) -> int:
        """Return the number of trials: of each controller and seed so many scenarios."""
        return self.trials * len(self.controllers) * scenarios

    def require_task(self) -> ExperimentTask:
        """Return the task.

        Raises:
            InvalidInputError: none was given.
        """
        if self.task is None:
            raise InvalidInputError("this experiment runs a task, and none is given; give ExperimentConfig(task=...)")
        return self.task

    def require_bundle(self) -> Bundle:
        """Return the policy bundle.

        Raises:
            InvalidInputError: none was given.
        """
        if self.bundle is None:
            raise InvalidInputError("this experiment runs a policy; give ExperimentConfig(bundle=Bundle.load(...))")
        return self.bundle


@dataclass(frozen=True)
class Entry:
    """One experiment as the registry has it.

    Attributes:
        name: on the command line.
        about: what it does, in half a line.
        run: the experiment, told of every trial done.
        count: how many trials of all controllers a configuration comes to.
        trials: seeds tried where nobody says how many.
        takes: what it takes beside controllers, trials and seed; a task or bundle that it takes it cannot do without.
    """

    name: str
    about: str
    run: Callable[[ExperimentConfig, Progress | None], Experiment]
    count: Callable[[ExperimentConfig], int] = ExperimentConfig.count
    trials: int = 10
    takes: tuple[Taken, ...] = ()
