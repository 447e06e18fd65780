"""All that training reads and writes in models of Stable-Baselines3 beyond its public interface, in one place.

Resuming to the bit needs what the library keeps to itself: its counters, the last observation, the buffers of recent
episodes. Their names are those of the versions below.
"""

from collections import deque
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.save_util import recursive_getattr
from stable_baselines3.common.type_aliases import TrainFreq

from contactsafe.core.errors import ContactSafeError

VERSIONS = ((2, 9), (3, 0))
"""First version that is known to fit, and first that is not."""

COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")


def check_version() -> None:
    """Refuse a version of Stable-Baselines3 whose internals are not known to be those used here.

    Raises:
        ContactSafeError: with what to install.
    """
    found = version("stable-baselines3")
    number = tuple(int(word) for word in found.split(".")[:2])
    if not VERSIONS[0] <= number < VERSIONS[1]:
        (low, minor), (high, _) = VERSIONS
        raise ContactSafeError(
            f"stable-baselines3 is {found}, and checkpoints need {low}.{minor} or later, before {high}; "
            f"run: pip install 'stable-baselines3>={low}.{minor},<{high}'"
        )


def variables(model: BaseAlgorithm) -> dict[str, torch.Tensor]:
    """Return the tensors that a model saves beside its parameters, by name."""
    _, names = model._get_torch_save_params()
    return {name: getattr(model, name).detach() for name in names}


def load_variables(model: BaseAlgorithm, saved: Mapping[str, torch.Tensor]) -> None:
    """Load what `variables` returned."""
    for name, value in saved.items():
        getattr(model, name).data.copy_(value)


def counters(model: BaseAlgorithm) -> dict[str, int]:
    """Return how far a model has come."""
    return {name: getattr(model, name) for name in COUNTERS}


def load_counters(model: BaseAlgorithm, saved: Mapping[str, int]) -> None:
    """Load what `counters` returned."""
    for name, value in saved.items():
        setattr(model, name, value)


def recent_length(model: BaseAlgorithm) -> int:
    """Return the number of recent episodes that a model keeps statistics of."""
    return int(model._stats_window_size)


def recent_episodes(model: BaseAlgorithm) -> tuple[list[Any], list[Any]]:
    """Return a model's statistics of recent episodes, and their successes."""
    return list(model.ep_info_buffer or ()), list(model.ep_success_buffer or ())


def load_recent_episodes(model: BaseAlgorithm, episodes: list[Any], successes: list[Any]) -> None:
    """Load what `recent_episodes` returned."""
    model.ep_info_buffer = deque(episodes, maxlen=recent_length(model))
    model.ep_success_buffer = deque(successes, maxlen=recent_length(model))


def last_step(model: BaseAlgorithm) -> tuple[Any, Any]:
    """Return the observation that a model acts on next, and which environments begin an episode with it."""
    return model._last_obs, model._last_episode_starts


def load_last_step(model: BaseAlgorithm, observation: np.ndarray, starts: np.ndarray) -> None:
    """Load what `last_step` returned."""
    model._last_obs, model._last_episode_starts = observation, starts


def component(model: BaseAlgorithm, name: str) -> Any:
    """Return a part of a model by its dotted name, such as an optimiser."""
    return recursive_getattr(model, name)


def replay_buffer(model: BaseAlgorithm) -> ReplayBuffer | None:
    """Return a model's replay buffer; None where it has none."""
    return model.replay_buffer if isinstance(model, OffPolicyAlgorithm) else None


def replay_slack(model: BaseAlgorithm, rollout_steps: int) -> int:
    """Return the most rows that come into a model's replay buffer between checkpoints."""
    every = model.train_freq if isinstance(model, OffPolicyAlgorithm) else None
    return rollout_steps + (int(every.frequency) if isinstance(every, TrainFreq) else 0)
