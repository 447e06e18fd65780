"""Tasks, each a room of its own and a line in `TASKS`; what all share is in `base`."""

from typing import Any

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.base.entry import TaskEntry

WIPING = "contactsafe/Wiping-v0"
WIPING_BULLET = "contactsafe/WipingBullet-v0"

TASKS = {
    entry.name: entry
    for entry in (
        TaskEntry(
            "wiping",
            environments={"mujoco": WIPING, "pybullet": WIPING_BULLET},
            entry_points={
                WIPING: ("contactsafe.tasks.wiping.env:WipingEnv", "contactsafe.tasks.wiping.env:WipingVectorEnv"),
                WIPING_BULLET: (
                    "contactsafe.tasks.wiping.bullet:WipingBulletEnv",
                    "contactsafe.tasks.wiping.bullet:WipingBulletVectorEnv",
                ),
            },
            module="contactsafe.tasks.wiping.task",
            has_camera=True,
        ),
    )
}
"""All tasks by name, the one that commands take where none is named first."""

DEFAULT_TASK = next(iter(TASKS))

ENGINES = TASKS["wiping"].environments
"""The wiping task by the engine that computes its physics."""


def task_by_name(name: str) -> TaskEntry:
    """Return a task's entry.

    Raises:
        InvalidInputError: the name is unknown.
    """
    if name not in TASKS:
        raise InvalidInputError(f"task '{name}' is unknown; choose from {', '.join(TASKS)}")
    return TASKS[name]


def register() -> None:
    """Make all tasks known to Gymnasium; importing contactsafe does this."""
    for entry in TASKS.values():
        entry.register()


def make_engine(engine: str, num_envs: int, config: Any = None) -> Any:
    """Make the vector environment of the wiping task in one of two engines; see `TaskEntry.make_vec`."""
    return TASKS["wiping"].make_vec(num_envs, config, engine)
