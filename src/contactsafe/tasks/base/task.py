"""A task as everything that takes one by its name sees it: training, evaluation, experiments, the command line."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Protocol

import numpy as np
import tyro

from contactsafe.control import presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.parse import one_of
from contactsafe.policy.conditions import Conditions
from contactsafe.tasks.base.config import TaskConfig
from contactsafe.tasks.base.pushes import Pushes
from contactsafe.tasks.base.scripted import RANDOM, Scripted
from contactsafe.tasks.base.tasks import Tasks


class MaskSampler(Protocol):
    """What a vision encoder is trained on; `homography` is that of the masks, (3, 3)."""

    homography: np.ndarray

    def sample(self, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Return n masks, uint8 (n, size, size), and tool positions, (n, 3), m."""
        ...


_AS_TRAINED = tyro.conf.arg(help_behavior_hint="(default: the one that the policy was trained over)")


@dataclass(frozen=True)
class TaskOptions:
    """What `contactsafe evaluate` can be told of any task; a task's own options extend them.

    Attributes:
        controller: preset underneath.
        pushed: push the arm now and then, 5 to 25 N on links 3 to 6.
    """

    controller: Annotated[str | None, one_of(presets.PRESETS, presets.by_name, presets.FORM), _AS_TRAINED] = None
    pushed: bool = False

    def settings(self) -> dict[str, Any]:
        """Return the fields of the task's configuration that these options set."""
        named = {} if self.controller is None else {"controller": self.controller}
        return {**named, "pushes": Pushes() if self.pushed else None}


@dataclass(frozen=True)
class Variant:
    """Another wording of a task.

    Attributes:
        config: fields of its configuration that differ.
        training_settings: settings of training that differ, for any algorithm.
    """

    config: Mapping[str, Any] = field(default_factory=dict)
    training_settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """A task: its simulation, and what others need to know of it; all but the simulation has defaults.

    Attributes:
        simulation: the task's subclass of `Tasks`.
        options: dataclass of the options that `contactsafe evaluate` has for it.
        randomised: fields of its configuration that differ while a policy is trained with randomisation.
        training_settings: settings of training that differ from an algorithm's own, by the name of the algorithm.
        as_paper: the task and its training as the paper words them; None where the paper has no such task.
        scripted: scripted policies by name.
        mask_sampler: makes a MaskSampler; None where the task has no camera.
        scenes: makes of its configuration what the paper's experiments ask of it, see `contactsafe.experiments.task`;
            None where there is nothing.
        robot: makes its `contactsafe.tasks.base.robot.RobotTask`; None where no real robot does it.
        warmup: what compiles besides, for `contactsafe warmup`: package that it needs, name, configuration, engine.
    """

    simulation: type[Tasks]
    options: type[TaskOptions] = TaskOptions
    randomised: Mapping[str, Any] = field(default_factory=dict)
    training_settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    as_paper: Variant | None = None
    scripted: Scripted = field(default_factory=lambda: RANDOM)
    mask_sampler: Callable[[], MaskSampler] | None = None
    scenes: Callable[..., Any] | None = None
    robot: Callable[[], Any] | None = None
    warmup: tuple[tuple[str, str, TaskConfig, str], ...] = ()

    @property
    def name(self) -> str:
        """What it is called, as in `--task NAME`."""
        return self.simulation.name

    def config(self, options: TaskOptions | None = None, conditions: Conditions | None = None) -> TaskConfig:
        """Return the task's configuration under options, and under the conditions of a policy."""
        return self._under(conditions, {} if options is None else options.settings())

    def training_config(
        self, randomise: bool, conditions: Conditions | None = None, gentleness: float = 1.0
    ) -> TaskConfig:
        """Return the configuration that policies are trained under.

        Args:
            randomise: worlds differ from episode to episode.
            conditions: of the policy.
            gentleness: factor on the weight `force` of the task's reward.

        Raises:
            InvalidInputError: the factor is not 1, and the task's reward has no such weight.
        """
        config = self._under(conditions, self.randomised if randomise else {})
        if gentleness == 1.0:
            return config
        reward: Any = getattr(config, "reward", None)
        if not hasattr(reward, "force"):
            raise InvalidInputError(
                f"gentleness = {gentleness}, but the reward of task '{self.name}' has no weight `force`; leave it at 1"
            )
        gentler: Any = {"reward": replace(reward, force=gentleness * reward.force)}
        return replace(config, **gentler)

    def settings_of(self, algorithm: str, as_paper: bool = False) -> dict[str, Any]:
        """Return the settings of training that differ from an algorithm's own."""
        return {**self.training_settings.get(algorithm, {}), **(self._paper().training_settings if as_paper else {})}

    def scripted_policy(self, name: str, config: TaskConfig, env: Any, seed: int) -> Any:
        """Make a scripted policy by name for a vector environment of the task.

        Raises:
            InvalidInputError: there is none of that name.
        """
        if name not in self.scripted:
            raise InvalidInputError(f"scripted policy '{name}' is unknown; choose one of {', '.join(self.scripted)}")
        return self.scripted[name](config, env, seed)

    def _under(self, conditions: Conditions | None, settings: Mapping[str, Any]) -> TaskConfig:
        kind = self.simulation.config_type
        if conditions is None:
            return kind(**settings)
        worded = self._paper().config if conditions.as_paper else {}
        config = kind(**{"controller": conditions.controller, **worded, **settings})
        return replace(config, action=replace(config.action, gains=conditions.gains))

    def _paper(self) -> Variant:
        if self.as_paper is None:
            raise InvalidInputError(f"the paper has no task '{self.name}'; leave --as-paper out")
        return self.as_paper
