"""A training run on disk: all that decides how it goes on, saved between updates and put back to the bit."""

from collections import deque

from contactsafe.errors import InvalidInputError
from contactsafe.learning.checkpoints import (
    check_same_config,
    check_unchanged,
    load_checkpoint,
    pack,
    plain,
    random_state,
    restore_random_state,
    save_checkpoint,
    unpack,
)
from contactsafe.learning.policy_config import SESSION_FIELDS
from contactsafe.learning.replay import ReplayFile
from contactsafe.processes import OfTraining
from contactsafe.sim.snapshot import generator_state

FORMAT = 3
"""Version of the checkpoint's layout."""

COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")


def load_run(config, encoder_digest):
    """Read the checkpoint of a run and make sure that it is this run's.

    Args:
        config: a PolicyConfig.
        encoder_digest: SHA-256 of the encoder it would go on with.

    Returns:
        The state for `Run.restore`.

    Raises:
        InvalidInputError: it cannot be read, or is of another version, algorithm, encoder, or of other settings.
    """
    state = load_checkpoint(config.out)
    if state.get("format") != FORMAT:
        raise InvalidInputError(f"{config.out} holds a run of another version; start anew with another --out")
    if state["algorithm"] != config.algorithm:
        raise InvalidInputError(
            f"{config.out} holds a run of {state['algorithm']}, not of {config.algorithm}; give another --out"
        )
    check_same_config(state["config"], config, SESSION_FIELDS)
    if state["encoder"] != encoder_digest:
        raise InvalidInputError(
            f"the encoder in {config.vae} is not the one that the run in {config.out} was started with; "
            "give that one's folder as --vae, or start anew with another --out"
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
                    "below": self.env.snapshot(),
                    "observation": model._last_obs,
                    "starts": model._last_episode_starts,
                }
            ),
        }
        save_checkpoint(self.config.out, state)
        self.saved_steps = model.num_timesteps

    def restore(self, state):
        """Put model and environment back to where a checkpoint left them; give the minutes it had trained.

        Raises:
            InvalidInputError: the run was started on another task, such as one with another reward.
        """
        check_unchanged(state["task"], self.task)
        model = self.model
        model.set_parameters(state["parameters"], exact_match=True)
        for name, value in state["variables"].items():
            getattr(model, name).data.copy_(value)
        for name, value in state["counters"].items():
            setattr(model, name, value)
        model.ep_info_buffer = deque(state["episodes"], maxlen=model._stats_window_size)
        model.ep_success_buffer = deque(state["successes"], maxlen=model._stats_window_size)
        model.action_space.np_random.bit_generator.state = state["random_actions"]
        if self.replay:
            self.replay.load(state["replay_rows"])
        env = unpack(state["env"])
        self.env.restore(env["below"])
        if self.env.keeps_worlds:
            model._last_obs, model._last_episode_starts = env["observation"], env["starts"]
        else:
            self.env.seed(self.config.seed + 7919 * (1 + model.num_timesteps))
        restore_random_state(state["random"])
        self.saved_steps = model.num_timesteps
        return state["minutes"]
