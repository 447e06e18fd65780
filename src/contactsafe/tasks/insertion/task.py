"""The insertion task as everything that takes a task by its name sees it."""

from dataclasses import dataclass
from typing import Any

from contactsafe.tasks.base.task import Task, TaskOptions
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.insertion.robot import InsertionRobot
from contactsafe.tasks.insertion.scenes import Insertion
from contactsafe.tasks.insertion.scripted import SCRIPTED
from contactsafe.tasks.insertion.tasks import InsertionTasks


@dataclass(frozen=True)
class InsertionOptions(TaskOptions):
    """What `contactsafe evaluate` can be told of the insertion task.

    Attributes:
        controller: preset underneath.
        pushed: push the arm now and then, 5 to 25 N on links 3 to 6.
        clearance_mm: radial, between peg and hole, mm.
        error_mm: the hole is within this of where it is believed to be, along x and along y, mm.
    """

    clearance_mm: float = 1e3 * InsertionConfig.clearance_m
    error_mm: float = 1e3 * InsertionConfig.error_m

    def settings(self) -> dict[str, Any]:
        """Return the fields of InsertionConfig that these options set."""
        return {**super().settings(), "clearance_m": self.clearance_mm / 1e3, "error_m": self.error_mm / 1e3}


PPO = {
    "num_envs": 32,
    "rollout_steps": 64,
    "total_steps": 600_000,
    "batch": 512,
    "discount": 0.99,
    "action_repeat": 2,
    "net": (128, 128),
    "log_std_init": -0.7,
    "log_std_final": -1.0,
    "target_kl": 0.1,
}
"""What PPO learns it with: 30 decisions a second, and more noise than by default."""

TASK = Task(
    InsertionTasks,
    InsertionOptions,
    training_settings={"ppo": PPO},
    scripted=SCRIPTED,
    scenes=Insertion,
    robot=InsertionRobot,
)
