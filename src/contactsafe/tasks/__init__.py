"""Gymnasium environments: the wiping task, single and vector, its actions and rewards, in two engines."""

from typing import Any, cast

import gymnasium

from contactsafe.core.errors import InvalidInputError

WIPING = "contactsafe/Wiping-v0"
WIPING_BULLET = "contactsafe/WipingBullet-v0"

ENGINES = {"mujoco": WIPING, "pybullet": WIPING_BULLET}
"""The wiping task by the engine that computes its physics."""


def register() -> None:
    """Make the wiping tasks known to Gymnasium; importing contactsafe does this."""
    for name, place in ((WIPING, "env:Wiping"), (WIPING_BULLET, "bullet:WipingBullet")):
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point=f"contactsafe.tasks.wiping.{place}Env",
                vector_entry_point=f"contactsafe.tasks.wiping.{place}VectorEnv",
            )


def make_engine(engine: str, num_envs: int, config: Any = None):
    """Make the vector environment of the wiping task in one of two engines.

    Args:
        engine: 'mujoco' or 'pybullet'.
        num_envs: how many boards.
        config: a `WipingConfig`; None for the defaults.

    Returns:
        A `WipingVectorEnv`.

    Raises:
        InvalidInputError: there is no such engine, or one that is not installed.
    """
    if engine not in ENGINES:
        raise InvalidInputError(f"engine = {engine!r}; choose {' or '.join(ENGINES)}")
    register()
    return cast(Any, gymnasium.make_vec(ENGINES[engine], num_envs=num_envs, config=config))
