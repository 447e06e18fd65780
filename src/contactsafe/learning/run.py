"""A training run on disk: all that decides how it goes on, saved between updates and put back to the bit."""

import math
from collections import deque
from copy import deepcopy

import numpy as np
import torch
from stable_baselines3.common.save_util import recursive_getattr

from contactsafe.core.copying import OfTraining
from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.core.state import generator_state
from contactsafe.learning.checking import CheckpointError, check_like, check_optimiser, check_tensor, part, whole
from contactsafe.learning.checkpoints import (
    check_random_state,
    check_same_config,
    check_unchanged,
    load_checkpoint,
    pack,
    plain,
    random_state,
    refused_as,
    restore_random_state,
    save_checkpoint,
    unpack,
)
from contactsafe.learning.policy_config import SESSION_FIELDS
from contactsafe.learning.replay import ReplayFile

FORMAT = 5
"""Version of the checkpoint's layout."""

COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")


def load_run(config, encoder_digest):
    """Read the checkpoint of a run and make sure that it is this run's.

    Args:
        config: a PolicyConfig.
        encoder_digest: SHA-256 of the encoder it would go on with.

    Returns:
        The state for `Run.load_state_dict`.

    Raises:
        InvalidInputError: it cannot be read, or is of another version, algorithm, encoder, or of other settings.
    """
    state = load_checkpoint(config.out)
    if state.get("format") != FORMAT:
        raise InvalidInputError(f"{config.out} holds a run of another version; start anew with another --out")
    with refused_as(config.out):
        algorithm, encoder = part(state, "algorithm", str), part(state, "encoder", str)
        settings = part(state, "config", dict)
    if algorithm != config.algorithm:
        raise InvalidInputError(
            f"{config.out} holds a run of {shown(algorithm)[1:-1]}, not of {config.algorithm}; give another --out"
        )
    with refused_as(config.out):
        check_same_config(settings, config, SESSION_FIELDS)
    if encoder != encoder_digest:
        raise InvalidInputError(
            f"the encoder in {config.encoder} is not the one that the run in {config.out} was started with; "
            "give that one's folder as --encoder, or start anew with another --out"
        )
    return state


class Run(OfTraining):
    """Saves and restores a model of Stable-Baselines3 together with its environment.

    Args:
        config: the PolicyConfig.
        model: made by it.
        env: the EncodedVecEnv the model learns in.
        encoder_digest: SHA-256 of the encoder.

    Attributes:
        saved_steps: steps of the policy at the last checkpoint; −1 before the first.
    """

    def __init__(self, config, model, env, encoder_digest):
        self.config, self.model, self.env = config, model, env
        self.encoder_digest = encoder_digest
        self.saved_steps = -1
        tasks = getattr(env.env.unwrapped, "tasks", None)
        self.task = {} if tasks is None else {"task": plain(tasks.config)}
        buffer = getattr(model, "replay_buffer", None)
        slack = config.rollout_steps + model.train_freq.frequency if buffer is not None else 0
        self.replay = None if buffer is None else ReplayFile(config.out / "replay.bin", buffer, slack)

    def save(self, minutes):
        """Write the checkpoint; call it between updates, when policy and optimiser fit together.

        Args:
            minutes: trained so far, over all sessions.
        """
        model = self.model
        _, variables = model._get_torch_save_params()
        state = {
            "format": FORMAT,
            "algorithm": self.config.algorithm,
            "config": plain(self.config),
            "encoder": self.encoder_digest,
            "task": self.task,
            "minutes": minutes,
            "parameters": model.get_parameters(),
            "variables": {name: getattr(model, name).detach() for name in variables},
            "counters": {name: getattr(model, name) for name in COUNTERS},
            "episodes": list(model.ep_info_buffer),
            "successes": list(model.ep_success_buffer),
            "random": random_state(),
            "random_actions": generator_state(model.action_space.np_random),
            "replay_rows": self.replay.save() if self.replay else 0,
            "env": pack(
                {
                    "below": self.env.state_dict(),
                    "observation": model._last_obs,
                    "starts": model._last_episode_starts,
                }
            ),
        }
        save_checkpoint(self.config.out, state)
        self.saved_steps = model.num_timesteps

    def load_state_dict(self, state):
        """Load model and environment from a checkpoint and return the minutes it had trained.

        Raises:
            InvalidInputError: the run was started on another task, such as one with another reward, or the checkpoint
                holds what this run cannot have written; then nothing is changed.
        """
        with refused_as(self.config.out):
            check_unchanged(part(state, "task", dict), self.task)
            env = self._check(state)
        model = self.model
        if self.replay:
            self.replay.load(state["replay_rows"])
        model.set_parameters(state["parameters"], exact_match=True)
        for name, value in state["variables"].items():
            getattr(model, name).data.copy_(value)
        for name, value in state["counters"].items():
            setattr(model, name, value)
        model.ep_info_buffer = deque(state["episodes"], maxlen=model._stats_window_size)
        model.ep_success_buffer = deque(state["successes"], maxlen=model._stats_window_size)
        model.action_space.np_random.bit_generator.state = state["random_actions"]
        self.env.load_state_dict(env["below"])
        if self.env.keeps_worlds:
            model._last_obs, model._last_episode_starts = env["observation"], env["starts"]
        else:
            self.env.seed(self.config.seed + 7919 * (1 + model.num_timesteps))
        restore_random_state(state["random"])
        self.saved_steps = model.num_timesteps
        return state["minutes"]

    def _check(self, state):
        """Refuse what `save` cannot have written for such a model and environment; give the environment's."""
        model = self.model
        self._check_parameters(part(state, "parameters", dict))
        _, variables = model._get_torch_save_params()
        check_like(
            part(state, "variables", dict), {name: getattr(model, name).detach() for name in variables}, "variables"
        )
        counters = part(state, "counters", dict)
        for name in COUNTERS:
            whole(counters, name)
        minutes = part(state, "minutes", (int, float))
        if not (math.isfinite(minutes) and minutes >= 0.0):
            raise CheckpointError(f"minutes = {shown(minutes)}")
        for name, most in (("episodes", model._stats_window_size), ("successes", model._stats_window_size)):
            if len(part(state, name, list)) > most:
                raise CheckpointError(f"{name} has {len(state[name])} entries, at most {most}")
        check_like(state["episodes"], len(state["episodes"]) * [{"r": 0.0, "l": 0, "t": 0.0}], "episodes")
        if not all(isinstance(success, bool | int | float) for success in state["successes"]):
            raise CheckpointError(f"successes are {shown(state['successes'])}")
        check_random_state(part(state, "random", dict))
        self._check_random_actions(part(state, "random_actions", dict))
        rows = whole(state, "replay_rows")
        if self.replay:
            self.replay.check(rows)
        return self._check_env(unpack(part(state, "env", dict)))

    def _check_parameters(self, parameters):
        wanted = self.model.get_parameters()
        if set(parameters) != set(wanted):
            raise CheckpointError(f"parameters are {shown(sorted(map(str, parameters)))}, not {shown(sorted(wanted))}")
        for name, value in wanted.items():
            kept = recursive_getattr(self.model, name)
            if isinstance(kept, torch.optim.Optimizer):
                check_optimiser(parameters[name], kept, f"parameters.{name}")
            elif isinstance(value, torch.Tensor):
                check_tensor(parameters[name], value, f"parameters.{name}")
            else:
                check_like(parameters[name], dict(value), f"parameters.{name}")

    def _check_random_actions(self, state):
        generator = deepcopy(self.model.action_space.np_random.bit_generator)
        try:
            generator.state = state
        except (KeyError, TypeError, ValueError, OverflowError):
            raise CheckpointError("random_actions is not a state of its generator") from None

    def _check_env(self, env):
        """Check what decides the environment's future, and the observation it gave last."""
        try:
            self.env.check(part(env, "below", dict))
        except InvalidInputError as error:
            raise CheckpointError(str(error).removesuffix("; start anew")) from None
        if self.env.keeps_worlds:
            n, space = self.env.num_envs, self.env.observation_space
            for name, shape, kind in (
                ("observation", (n, *space.shape), space.dtype),
                ("starts", (n,), np.dtype(bool)),
            ):
                array = part(env, name, np.ndarray)
                if array.shape != shape or array.dtype != kind or not np.isfinite(array).all():
                    raise CheckpointError(f"{name} is {array.dtype} of shape {array.shape}, or not finite")
        return env
