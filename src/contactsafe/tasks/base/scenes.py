"""A task as the experiments see it: what all tasks have of it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Generic, TypeVar

from contactsafe.policy.action_config import LEARNED_GAINS, ActionConfig
from contactsafe.results.recording import Colour, Stage
from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.obstacles import Obstacle
from contactsafe.tasks.base.config import TaskConfig
from contactsafe.tasks.base.tasks import Tasks

T = TypeVar("T", bound=Tasks)
C = TypeVar("C", bound=TaskConfig)
Corners = tuple[tuple[float, float, float], ...]


class TaskScenes(Generic[T, C]):
    """Part of `contactsafe.experiments.task.ExperimentTask`; a task adds its episodes, metrics and script.

    Args:
        config: of the task, as the policy has learned it; the controllers that are compared stand in for its own.
        arm: that works.
        surface: corners of the stage's surface, as `level_rectangle` returns them.
        colours: of its cells by their values.

    Attributes:
        config, arm: as given.
        stage: on which episodes are filmed.
    """

    tasks_type: type[T]
    """Tasks that run the episodes."""

    def __init__(self, config: C, arm: Arm, surface: Corners, colours: Mapping[int, Colour]):
        self.config, self.arm = config, arm
        self.stage = Stage(*description_and_tool(arm), surface, colours)

    def under(self, controller: str) -> C:
        """Return the task's configuration with another controller."""
        return replace(self.config, controller=controller)

    def steady_action(self, stiffness: Sequence[float]) -> ActionConfig:
        """Return how actions of a script move the target, which leave K1 as it is, (6,) 1/s²."""
        return replace(self.config.action, stiffness_start=tuple(stiffness), gains=LEARNED_GAINS)  # type: ignore[arg-type]

    def with_obstacle(self, obstacle: Obstacle) -> WorldConfig:
        """Return the task's world with an obstacle in it, before those that it has."""
        return replace(self.config.world, obstacles=(obstacle, *self.config.world.obstacles))

    def with_errors_of(self, world: WorldConfig) -> WorldConfig:
        """Return the task's world with plant and sensors of another."""
        return replace(self.config.world, plant=world.plant, sensors=world.sensors)

    def make_tasks(self, config: C, seeds: Sequence[int], worlds: Sequence[WorldConfig] | None = None) -> T:
        """Make one task a seed, each in a world of its own where they are given."""
        return self.tasks_type(config, len(seeds), list(seeds), worlds, self.arm)
