"""Scripted policies that any task has."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.policy.action_config import ACTION_SIZE

Scripted = Mapping[str, Callable[[Any, Any, int], Any]]
"""Scripted policies by name, each made by `make(config, vec_env, seed)`."""


def hold_still(observation: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return actions that change nothing, (N, 18)."""
    return np.zeros((len(observation["target"]), ACTION_SIZE))


class RandomPolicy(Independent):
    """Actions sampled uniformly from all that are allowed.

    Args:
        num_envs: tasks side by side.
        seed: of the samples.
    """

    def __init__(self, num_envs: int, seed: int):
        self._rng, self._shape = np.random.default_rng(seed), (num_envs, ACTION_SIZE)

    def act(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Sample the actions, (N, 18)."""
        return self._rng.uniform(-1.0, 1.0, self._shape).astype(np.float32)


RANDOM: Scripted = {"random": lambda config, env, seed: RandomPolicy(env.num_envs, seed)}
"""What every task has."""
