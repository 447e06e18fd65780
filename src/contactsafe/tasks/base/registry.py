"""The tasks by name; each is imported when it is first asked for."""

import importlib
import os
import re
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

import gymnasium

from contactsafe.core.errors import InvalidInputError, shown

if TYPE_CHECKING:
    from contactsafe.tasks.base.task import Task

TASKS: dict[str, str] = {}
"""Where every task is, by its name; see `register_task`."""

_IMPORTED: dict[str, str] = {}  # tasks that were named as module:name, by name

ENGINES = ("mujoco", "pybullet")
"""What may compute the physics of a task."""


def register_task(name: str, place: str) -> None:
    """Make a task known by a name: to `--task`, to evaluation and bundles, and to Gymnasium as contactsafe/Name-v0.

    Args:
        name: lower case, such as 'wiping'.
        place: 'module:NAME' of its `Task`, or of its subclass of `Tasks`, which is then a Task with all defaults.

    Raises:
        InvalidInputError: the name or the place is not of that form; what is there is seen when it is first asked for.
    """
    if not isinstance(name, str) or not re.fullmatch(r"[a-z][a-z0-9_-]*", name):
        raise InvalidInputError(f"task {shown(name)}: give a name in lower case, such as 'wiping'")
    if not isinstance(place, str) or not re.fullmatch(r"[\w.]+:\w+", place):
        raise InvalidInputError(
            f"task '{name}': place = {shown(place)}; give 'module:NAME' of its Task or of its subclass of Tasks, such "
            f"as '{name}:{name.capitalize()}Tasks'"
        )
    TASKS[name] = place
    if env_id(name) not in gymnasium.registry:
        gymnasium.register(
            env_id(name),
            entry_point="contactsafe.tasks.base.task_env:TaskEnv",
            vector_entry_point="contactsafe.tasks.base.task_vector_env:TaskVectorEnv",
            kwargs={"task": name},
        )


TASK_FORM = "MODULE:NAME"
"""What the command line takes beside the name of a task."""


def import_task(place: str) -> str:
    """Import the module that registers a task, also from the current folder; return the task's name.

    Args:
        place: 'module:name', such as 'press:press'.

    Raises:
        InvalidInputError: there is no such module, it cannot be imported, or it registers no task of that name.
    """
    module, _, name = place.rpartition(":")
    sys.path.insert(0, os.getcwd())
    try:
        importlib.import_module(module)
    except Exception as error:
        raise InvalidInputError(
            f"task '{place}': module {module} cannot be imported: {shown(error)}; run the command in "
            f"the folder of {module}.py, or name that folder in PYTHONPATH"
        ) from None
    finally:
        sys.path.remove(os.getcwd())
    if name not in TASKS:
        raise InvalidInputError(f"task '{place}': {module} registers no task '{name}'; it needs register_task")
    _IMPORTED[name] = place
    return name


def place_of(name: str) -> str:
    """Return what the command line calls a task: its name, or module:name where it was imported so."""
    return _IMPORTED.get(name, name)


def env_id(name: str) -> str:
    """Return the Gymnasium id of a task."""
    return f"contactsafe/{name.capitalize()}-v0"


def task_by_name(name: str) -> "Task":
    """Import a task.

    Raises:
        InvalidInputError: no task has this name, it is not where it was registered, or calls itself otherwise.
    """
    from contactsafe.tasks.base.task import Task
    from contactsafe.tasks.base.tasks import Tasks

    if name not in TASKS:
        raise InvalidInputError(f"task '{name}' is unknown; choose from {', '.join(TASKS)}")
    module, attribute = TASKS[name].split(":")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except Exception as error:
        raise InvalidInputError(
            f"task '{name}': {TASKS[name]} cannot be imported: {shown(error)}; give register_task the 'module:NAME' of "
            "its Task or of its subclass of Tasks"
        ) from error
    task = Task(found) if isinstance(found, type) and issubclass(found, Tasks) else found
    if not isinstance(task, Task):
        raise InvalidInputError(
            f"task '{name}': {TASKS[name]} is {shown(found)}, no Task and no subclass of Tasks; register one"
        )
    if task.name != name:
        raise InvalidInputError(f"task '{name}': {TASKS[name]} calls itself '{task.name}'; register it by that name")
    return task


def make_vec(name: str, num_envs: int, config: Any = None, engine: str = "mujoco", **others: Any) -> Any:
    """Make a task's vector environment.

    Args:
        name: of the task.
        num_envs: how many.
        config: of the task; None for the defaults.
        engine: one of `ENGINES`.
        others: further arguments of `TaskVectorEnv`.

    Raises:
        InvalidInputError: no task has this name; there is no such engine, or it is not installed.
    """
    if name not in TASKS:
        task_by_name(name)
    return cast(Any, gymnasium.make_vec(env_id(name), num_envs=num_envs, config=config, engine=engine, **others))


def backend_of(engine: str) -> Callable[..., Any] | None:
    """Return what computes the physics in an engine, None for MuJoCo, which is built in.

    Raises:
        InvalidInputError: no engine has this name.
    """
    if engine not in ENGINES:
        raise InvalidInputError(f"engine = {engine!r}; choose {' or '.join(ENGINES)}")
    if engine == "mujoco":
        return None
    from contactsafe.sim.bullet_backend import BulletBackend

    return BulletBackend
