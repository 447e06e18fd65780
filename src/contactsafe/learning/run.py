"""A training run on disk: all that decides how it goes on, saved between updates and loaded to the bit."""

import math
from copy import deepcopy
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from contactsafe.core.copying import OfTraining
from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.core.state import generator_state
from contactsafe.learning import sb3
from contactsafe.learning.checking import CheckpointError, check_like, check_optimiser, check_tensor, entry, whole
from contactsafe.learning.checkpoints import load_checkpoint, refused_as, save_checkpoint
from contactsafe.learning.packing import pack, unpack
from contactsafe.learning.policy_config import SESSION_FIELDS, PolicyConfig
from contactsafe.learning.random_state import check_random_state, load_random_state, random_state
from contactsafe.learning.replay import ReplayFile
from contactsafe.learning.run_settings import check_same_config, check_unchanged, plain

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

    from contactsafe.learning.vec_env import EncodedVecEnv

FORMAT = 6
"""Version of the checkpoint's layout."""


def load_run(config: PolicyConfig, encoder_digest: str) -> dict[str, Any]:
    """Read the checkpoint of a run and make sure that it is this run's.

    Args:
        config: the settings now.
        encoder_digest: SHA-256 of the encoder it would go on with, empty where it has none.

    Returns:
        The state for `Run.load_state_dict`.

    Raises:
        InvalidInputError: it cannot be read, or is of another version, algorithm, encoder, or of other settings.
    """
    state = load_checkpoint(config.out)
    if state.get("format") != FORMAT:
        raise InvalidInputError(f"{config.out} holds a run of another version; start anew with another --out")
    with refused_as(config.out):
        algorithm, encoder = entry(state, "algorithm", str), entry(state, "encoder", str)
        settings = entry(state, "config", dict)
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
    """Saves and loads a model of Stable-Baselines3 together with its environment.

    Args:
        config: the settings.
        model: made by it.
        env: the environment the model learns in.
        encoder_digest: SHA-256 of the encoder, empty where there is none.

    Attributes:
        saved_steps: steps of the policy at the last checkpoint; −1 before the first.
    """

    def __init__(self, config: PolicyConfig, model: "BaseAlgorithm", env: "EncodedVecEnv", encoder_digest: str):
        sb3.check_version()
        self.config, self.model, self.env = config, model, env
        self.encoder_digest = encoder_digest
        self.saved_steps = -1
        tasks = getattr(env.env.unwrapped, "tasks", None)
        self.task: dict[str, Any] = {} if tasks is None else {"task": plain(tasks.config)}
        buffer, self.replay = sb3.replay_buffer(model), None
        if buffer is not None:
            self.replay = ReplayFile(config.out / "replay.bin", buffer, sb3.replay_slack(model, config.rollout_steps))

    def save(self, minutes: float) -> None:
        """Write the checkpoint; call it between updates, when policy and optimiser fit together.

        Args:
            minutes: trained so far, over all sessions.
        """
        model = self.model
        episodes, successes = sb3.recent_episodes(model)
        observation, starts = sb3.last_step(model)
        state = {
            "format": FORMAT,
            "algorithm": self.config.algorithm,
            "config": plain(self.config),
            "encoder": self.encoder_digest,
            "task": self.task,
            "minutes": minutes,
            "parameters": model.get_parameters(),
            "variables": sb3.variables(model),
            "counters": sb3.counters(model),
            "episodes": episodes,
            "successes": successes,
            "random": random_state(),
            "random_actions": generator_state(model.action_space.np_random),
            "replay_rows": self.replay.save() if self.replay else 0,
            "env": pack({"below": self.env.state_dict(), "observation": observation, "starts": starts}),
        }
        save_checkpoint(self.config.out, state)
        self.saved_steps = model.num_timesteps

    def load_state_dict(self, state: dict[str, Any]) -> float:
        """Load model and environment from a checkpoint and return the minutes it had trained.

        Raises:
            InvalidInputError: the run was started on another task, such as one with another reward, or the checkpoint
                holds what this run cannot have written; then nothing is changed.
        """
        with refused_as(self.config.out):
            check_unchanged(entry(state, "task", dict), self.task)
            env = self._check(state)
        self._check_steps(state["config"]["total_steps"], state["counters"]["num_timesteps"])
        model = self.model
        if self.replay:
            self.replay.load(state["replay_rows"])
        model.set_parameters(state["parameters"], exact_match=True)
        sb3.load_variables(model, state["variables"])
        sb3.load_counters(model, state["counters"])
        sb3.load_recent_episodes(model, state["episodes"], state["successes"])
        model.action_space.np_random.bit_generator.state = state["random_actions"]
        self.env.load_state_dict(env["below"])
        if self.env.keeps_worlds:
            sb3.load_last_step(model, env["observation"], env["starts"])
        else:
            self.env.seed(self.config.seed + 7919 * (1 + model.num_timesteps))
        load_random_state(state["random"])
        self.saved_steps = model.num_timesteps
        return float(state["minutes"])

    def _check_steps(self, before: Any, done: int) -> None:
        """Refuse to end a run before where it is, when that was not its end before."""
        wanted = self.config.total_steps
        if wanted != before and wanted < done:
            raise InvalidInputError(
                f"total_steps = {wanted}, but the run in {self.config.out} has done {done} already; give more, or "
                "leave it out"
            )

    def _check(self, state: dict[str, Any]) -> dict[str, Any]:
        """Refuse what `save` cannot have written for such a model and environment; return the environment's."""
        self._check_parameters(entry(state, "parameters", dict))
        check_like(entry(state, "variables", dict), sb3.variables(self.model), "variables")
        counters = entry(state, "counters", dict)
        for name in sb3.COUNTERS:
            whole(counters, name)
        minutes = entry(state, "minutes", (int, float))
        if not (math.isfinite(minutes) and minutes >= 0.0):
            raise CheckpointError(f"minutes = {shown(minutes)}")
        self._check_recent(state)
        check_random_state(entry(state, "random", dict))
        self._check_random_actions(entry(state, "random_actions", dict))
        rows = whole(state, "replay_rows")
        if self.replay:
            self.replay.check(rows)
        return self._check_env(unpack(entry(state, "env", dict)))

    def _check_recent(self, state: dict[str, Any]) -> None:
        most = sb3.recent_length(self.model)
        for name in ("episodes", "successes"):
            if len(entry(state, name, list)) > most:
                raise CheckpointError(f"{name} has {len(state[name])} entries, at most {most}")
        check_like(state["episodes"], len(state["episodes"]) * [{"r": 0.0, "l": 0, "t": 0.0}], "episodes")
        if not all(isinstance(success, bool | int | float) for success in state["successes"]):
            raise CheckpointError(f"successes are {shown(state['successes'])}")

    def _check_parameters(self, parameters: dict[str, Any]) -> None:
        wanted: dict[str, Any] = self.model.get_parameters()
        if set(parameters) != set(wanted):
            raise CheckpointError(f"parameters are {shown(sorted(map(str, parameters)))}, not {shown(sorted(wanted))}")
        for name, value in wanted.items():
            kept = sb3.component(self.model, name)
            if isinstance(kept, torch.optim.Optimizer):
                check_optimiser(parameters[name], kept, f"parameters.{name}")
            elif isinstance(value, torch.Tensor):
                check_tensor(parameters[name], value, f"parameters.{name}")
            else:
                check_like(parameters[name], dict(value), f"parameters.{name}")

    def _check_random_actions(self, state: dict[str, Any]) -> None:
        generator = deepcopy(self.model.action_space.np_random.bit_generator)
        try:
            generator.state = state
        except (KeyError, TypeError, ValueError, OverflowError):
            raise CheckpointError("random_actions is not a state of its generator") from None

    def _check_env(self, env: dict[str, Any]) -> dict[str, Any]:
        """Check what decides the environment's future, and the observation it gave last."""
        try:
            self.env.check(entry(env, "below", dict))
        except InvalidInputError as error:
            raise CheckpointError(str(error).removesuffix("; start anew")) from None
        if self.env.keeps_worlds:
            n, space = self.env.num_envs, self.env.observation_space
            for name, shape, kind in (
                ("observation", (n, *(space.shape or ())), space.dtype),
                ("starts", (n,), np.dtype(bool)),
            ):
                array = entry(env, name, np.ndarray)
                if array.shape != shape or array.dtype != kind or not np.isfinite(array).all():
                    raise CheckpointError(f"{name} is {array.dtype} of shape {array.shape}, or not finite")
        return env
