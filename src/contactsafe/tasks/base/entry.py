"""What everything that takes a task by its name needs to know of one."""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, cast

import gymnasium
import numpy as np

from contactsafe.core.errors import InvalidInputError


class MaskSampler(Protocol):
    """What a vision encoder is trained on; `homography` is that of the masks, (3, 3)."""

    homography: np.ndarray

    def sample(self, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Return n masks, uint8 (n, size, size), and tool positions, (n, 3), m."""
        ...


@dataclass(frozen=True)
class Task:
    """The parts of a task that are made when it is used.

    Attributes:
        options: dataclass of the options that `contactsafe evaluate` has for this task; its `config()` returns the
            task's configuration.
        training_config: `training_config(randomise)` returns the configuration that policies are trained under.
        scripted: scripted policies by name, each made by `make(config, vec_env, seed)`.
        mask_sampler: makes a MaskSampler; None where the task has no camera.
        variants: what compiles besides, for `contactsafe warmup`: package that it needs, name, configuration, engine.
    """

    options: type
    training_config: Callable[[bool], Any]
    scripted: Mapping[str, Callable[[Any, Any, int], Any]]
    mask_sampler: Callable[[], MaskSampler] | None = None
    variants: tuple[tuple[str, str, Any, str | None], ...] = ()


@dataclass(frozen=True)
class TaskEntry:
    """A task's line in the registry, `contactsafe.tasks.TASKS`.

    Attributes:
        name: of the task, on the command line and in bundles.
        environments: Gymnasium id by the engine that computes its physics, the usual one first.
        entry_points: of its environments by id, "module:Class" for a single one and for a vector.
        module: that holds its `TASK`.
        has_camera: whether its policies see images.
    """

    name: str
    environments: Mapping[str, str]
    entry_points: Mapping[str, tuple[str, str]]
    module: str
    has_camera: bool = False

    @property
    def task(self) -> Task:
        """The task; its module is imported now."""
        return cast(Task, importlib.import_module(self.module).TASK)

    def register(self) -> None:
        """Make the task's environments known to Gymnasium."""
        for env_id, (single, vector) in self.entry_points.items():
            if env_id not in gymnasium.registry:
                gymnasium.register(env_id, entry_point=single, vector_entry_point=vector)

    def make_vec(self, num_envs: int, config: Any = None, engine: str | None = None) -> Any:
        """Make the task's vector environment.

        Args:
            num_envs: how many.
            config: of the task; None for the defaults.
            engine: one of `environments`; None for the usual one.

        Raises:
            InvalidInputError: unknown engine, or one that is not installed.
        """
        engine = engine or next(iter(self.environments))
        if engine not in self.environments:
            raise InvalidInputError(f"engine = {engine!r}; choose {' or '.join(self.environments)}")
        self.register()
        return cast(Any, gymnasium.make_vec(self.environments[engine], num_envs=num_envs, config=config))
