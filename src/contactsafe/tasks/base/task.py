"""A task as everything that takes one by its name sees it: training, evaluation, experiments, the command line."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Protocol

import numpy as np

from contactsafe.control import presets
from contactsafe.core.parse import one_of
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


@dataclass(frozen=True)
class TaskOptions:
    """What `contactsafe evaluate` can be told of any task; a task's own options extend them.

    Attributes:
        controller: preset underneath.
        pushed: push the arm now and then, 5 to 25 N on links 3 to 6.
    """

    controller: Annotated[str, one_of(presets.PRESETS, presets.by_name)] = TaskConfig.controller
    pushed: bool = False

    def settings(self) -> dict[str, Any]:
        """Return the fields of the task's configuration that these options set."""
        return {"controller": self.controller, "pushes": Pushes() if self.pushed else None}


@dataclass(frozen=True)
class Task:
    """A task: its simulation, and what others need to know of it; all but the simulation has defaults.

    Attributes:
        simulation: the task's subclass of `Tasks`.
        options: dataclass of the options that `contactsafe evaluate` has for it.
        training: fields of its configuration while a policy is trained with randomisation.
        scripted: scripted policies by name.
        mask_sampler: makes a MaskSampler; None where the task has no camera.
        scenes: makes what the paper's experiments ask of it, see `contactsafe.experiments.task`; None where there is
            nothing.
        variants: what compiles besides, for `contactsafe warmup`: package that it needs, name, configuration, engine.
    """

    simulation: type[Tasks]
    options: type[TaskOptions] = TaskOptions
    training: Mapping[str, Any] = field(default_factory=dict)
    scripted: Scripted = field(default_factory=lambda: RANDOM)
    mask_sampler: Callable[[], MaskSampler] | None = None
    scenes: Callable[[], Any] | None = None
    variants: tuple[tuple[str, str, TaskConfig, str], ...] = ()

    @property
    def name(self) -> str:
        """What it is called, as in `--task NAME`."""
        return self.simulation.name

    def config(self, options: TaskOptions | None = None) -> TaskConfig:
        """Return the task's configuration under options."""
        return self.simulation.config_type(**({} if options is None else options.settings()))

    def training_config(self, randomise: bool) -> TaskConfig:
        """Return the configuration that policies are trained under."""
        return self.simulation.config_type(**(self.training if randomise else {}))
