"""The tasks by name; each is imported when it is first asked for."""

import importlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from contactsafe.core.errors import InvalidInputError

if TYPE_CHECKING:
    from contactsafe.tasks.base.tasks import Tasks

_PLACES: dict[str, str] = {}
"""Where each task's class is, `module:Class`."""

ENGINES = ("mujoco", "pybullet")
"""What may compute the physics of a task."""


def register_task(name: str, place: str) -> None:
    """Make a task known by a name: to `--task`, to evaluation and bundles, and to Gymnasium as contactsafe/Name-v0.

    Args:
        name: lower case, such as 'wiping'.
        place: 'module:Class' of its subclass of `Tasks`.
    """
    import gymnasium

    _PLACES[name] = place
    if env_id(name) not in gymnasium.registry:
        at = "contactsafe.tasks.base.environment:Task"
        gymnasium.register(
            env_id(name), entry_point=f"{at}Env", vector_entry_point=f"{at}VectorEnv", kwargs={"task": name}
        )


def task_names() -> tuple[str, ...]:
    """Return the names of the tasks that are known."""
    return tuple(_PLACES)


def env_id(name: str) -> str:
    """Return the Gymnasium id of a task."""
    return f"contactsafe/{name.capitalize()}-v0"


def tasks_type(name: str) -> type["Tasks"]:
    """Import a task's class.

    Raises:
        InvalidInputError: no task has this name.
    """
    if name not in _PLACES:
        raise InvalidInputError(f"task = {name!r} is unknown; choose one of {', '.join(_PLACES)}")
    module, attribute = _PLACES[name].split(":")
    return getattr(importlib.import_module(module), attribute)


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
