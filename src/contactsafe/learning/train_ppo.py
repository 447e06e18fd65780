"""Train the policy: PPO of Stable-Baselines3 on [pose, latent], with the free-space controller underneath."""

import json
import time
from dataclasses import dataclass
from pathlib import Path

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from torch import nn
from tqdm import tqdm

from contactsafe.errors import InvalidInputError
from contactsafe.learning.checkpoints import (
    check_same_config,
    load_checkpoint,
    plain,
    prepare_folder,
    random_state,
    restore_random_state,
    save_checkpoint,
    write_json,
)
from contactsafe.learning.evaluation import HELD_OUT_SEED, evaluate_policy
from contactsafe.learning.export import export_bundle
from contactsafe.learning.perception import Perception, open_session
from contactsafe.learning.policy import Policy
from contactsafe.learning.vec_env import EncodedVecEnv, ObservationScaling

SESSION_FIELDS = (
    "out",
    "resume",
    "total_steps",
    "max_minutes",
    "checkpoint_rollouts",
    "evaluate_episodes",
    "threads",
    "encoder_threads",
)
"""Settings that may change when a run goes on."""


@dataclass(frozen=True)
class PpoConfig:
    """Settings of PPO.

    Attributes:
        vae: folder of the trained encoder (encoder.onnx, vae.json).
        out: folder of the run: checkpoint, TensorBoard log, and at its end a bundle.
        resume: go on from the checkpoint in out.
        env_id: Gymnasium id of the task.
        num_envs: environments side by side.
        total_steps: steps of the policy, over all environments and sessions.
        max_minutes: stop after this long in this session, keep a checkpoint and export what there is; 0 for no limit.
        rollout_steps: steps of each environment between updates.
        batch: samples in a gradient step.
        epochs: passes over a rollout.
        learning_rate: of Adam; falls linearly to a twentieth.
        discount: the paper's γ of RL, for one environment step; raised to action_repeat.
        gae_lambda: of the advantage estimate.
        clip_range: the paper's ε.
        entropy_weight: bonus on the entropy of the action distribution.
        value_weight: weight of the value loss.
        max_grad_norm: gradients are clipped to this.
        target_kl: an update stops early when the policy moved further than this.
        log_std_init: log of the first standard deviation of each action.
        net: widths of the hidden layers, of policy and of value network.
        action_repeat: environment steps for which one action is given.
        reward_scale: rewards are multiplied by this before learning; logs are not.
        pose_centre: subtracted from the pose: middle of the board, m; rad.
        pose_scale: divided by: half the ink area along x and y, a hand's breadth of height, m; rad.
        rate_hz: of environment steps.
        checkpoint_rollouts: rollouts between checkpoints.
        evaluate_episodes: on boards never trained on, at the end; 0 for none.
        seed: of weights, exploration and boards.
        threads: torch's. More than one crawls as soon as anything else wants a core.
        encoder_threads: ONNX Runtime's.
    """

    vae: Path = Path("runs/vae")
    out: Path = Path("runs/ppo")
    resume: bool = False
    env_id: str = "contactsafe/Wiping-v0"
    num_envs: int = 16
    total_steps: int = 3_000_000
    max_minutes: float = 0.0
    rollout_steps: int = 256
    batch: int = 512
    epochs: int = 5
    learning_rate: float = 3e-4
    discount: float = 0.995
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    entropy_weight: float = 0.0
    value_weight: float = 0.5
    max_grad_norm: float = 0.5
    target_kl: float = 0.03
    log_std_init: float = -1.0
    net: tuple[int, ...] = (256, 128)
    action_repeat: int = 1
    reward_scale: float = 1.0
    pose_centre: tuple[float, float, float, float, float, float] = (0.5, 0.0, 0.01, 0.0, 0.0, 0.0)
    pose_scale: tuple[float, float, float, float, float, float] = (0.15, 0.15, 0.03, 0.1, 0.1, 0.1)
    rate_hz: float = 60.0
    checkpoint_rollouts: int = 20
    evaluate_episodes: int = 64
    seed: int = 0
    threads: int = 1
    encoder_threads: int = 2


def train_ppo(config, make_env=None):
    """Train, export a bundle, and evaluate it on held-out boards.

    Args:
        config: a PpoConfig.
        make_env: `make_env(num_envs)` gives the vector environment; None makes config.env_id through Gymnasium.

    Returns:
        The results written into the bundle, a dict.

    Raises:
        InvalidInputError: no encoder in config.vae, nothing to resume, or settings differ from the run's.
        OutputError: out cannot be written, or holds another run.
    """
    encoder, vae = _load_encoder(config.vae)
    make_env = make_env or (lambda num_envs: gymnasium.make_vec(config.env_id, num_envs=num_envs))
    out = prepare_folder(config.out, config.resume)
    torch.set_num_threads(config.threads)
    raw_env = make_env(config.num_envs)
    session = open_session(encoder, str(config.vae / "encoder.onnx"), config.encoder_threads)
    view = (vae["representation"], vae["window_m"], vae["size"])
    perception = Perception(session, *view, _homography(raw_env))
    scaling = ObservationScaling.from_statistics(
        config.pose_centre, config.pose_scale, vae["latent_mean"], vae["latent_std"]
    )
    env = EncodedVecEnv(raw_env, perception, scaling, config.action_repeat, config.reward_scale)
    model = _make_model(config, env)
    trained_minutes = 0.0
    if config.resume:
        trained_minutes = _restore(model, env, out, config)
    write_json(out / "config.json", plain(config))
    recorder = _Recorder(config, out, trained_minutes)
    remaining = config.total_steps - model.num_timesteps
    if remaining > 0:
        model.learn(remaining, callback=recorder, reset_num_timesteps=False)
        recorder.save()
    description = {
        "representation": vae["representation"],
        "window_m": vae["window_m"],
        "view_size": vae["size"],
        "rate_hz": config.rate_hz,
        "action_repeat": config.action_repeat,
        "training": {
            "ppo": _portable(plain(config)),
            "vae": {
                key: _portable(value) if key == "config" else value
                for key, value in vae.items()
                if not key.startswith("latent_")
            },
            "steps": model.num_timesteps,
            "minutes": round(recorder.minutes(), 1),
        },
        "results": {},
    }
    layers = nn.Sequential(model.policy.mlp_extractor.policy_net, model.policy.action_net)
    folder = export_bundle(out / "bundle", encoder, layers, scaling, description, force=True)
    env.close()
    if config.evaluate_episodes:
        description["results"] = _evaluate(folder, make_env, config)
        export_bundle(folder, encoder, layers, scaling, description, force=True)
    return description["results"]


def _portable(settings):
    """Leave out what names folders of this machine, or this session only."""
    return {key: value for key, value in settings.items() if key not in ("vae", "out", "resume")}


def _load_encoder(folder):
    try:
        return (folder / "encoder.onnx").read_bytes(), json.loads((folder / "vae.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InvalidInputError(
            f"{folder} holds no trained encoder (encoder.onnx, vae.json); run `contactsafe train vae` first"
        ) from error


def _homography(env):
    return getattr(env, "unwrapped", env).camera_homography


def _make_model(config, env):
    model = PPO(
        "MlpPolicy",
        env,
        learning_rate=lambda remaining: config.learning_rate * max(remaining, 0.05),
        n_steps=config.rollout_steps,
        batch_size=config.batch,
        n_epochs=config.epochs,
        gamma=config.discount**config.action_repeat,
        gae_lambda=config.gae_lambda,
        clip_range=config.clip_range,
        ent_coef=config.entropy_weight,
        vf_coef=config.value_weight,
        max_grad_norm=config.max_grad_norm,
        target_kl=config.target_kl,
        policy_kwargs={
            "net_arch": {"pi": list(config.net), "vf": list(config.net)},
            "activation_fn": nn.Tanh,
            "log_std_init": config.log_std_init,
        },
        seed=config.seed,
        device="cpu",
    )
    model.set_logger(configure(str(config.out), ["tensorboard"]))
    return model


def _restore(model, env, out, config):
    """Put the model back to where the checkpoint left it; give the minutes it had trained."""
    state = load_checkpoint(out)
    check_same_config(state["config"], config, SESSION_FIELDS)
    model.policy.load_state_dict(state["policy"])
    model.policy.optimizer.load_state_dict(state["optimiser"])
    model.num_timesteps, model._n_updates = state["steps"], state["updates"]
    restore_random_state(state["random"])
    # The worlds themselves are not kept: episodes start anew, on boards not seen before.
    env.seed(config.seed + 7919 * (1 + state["updates"]))
    return state["minutes"]


def _evaluate(folder, make_env, config):
    env = make_env(min(config.num_envs, config.evaluate_episodes))
    try:
        policy = Policy(folder, _homography(env))
        with tqdm(total=config.evaluate_episodes, desc="held-out boards", unit="episode") as bar:
            seed = config.seed + HELD_OUT_SEED
            results = evaluate_policy(
                policy, env, config.evaluate_episodes, seed, config.rate_hz, lambda _: bar.update()
            )
    finally:
        env.close()
    del results["records"]
    return {**results, "seed": seed}


class _Recorder(BaseCallback):
    """Logs, shows progress, checkpoints between updates, and keeps to the time allowed."""

    def __init__(self, config, out, minutes_before):
        super().__init__()
        self.config = config
        self.out = out
        self.minutes_before = minutes_before
        self.started = time.monotonic()
        self.rollouts = 0
        self.bar = tqdm(disable=True)

    def minutes(self):
        """Time trained over all sessions, min."""
        return self.minutes_before + (time.monotonic() - self.started) / 60.0

    def _on_training_start(self):
        self.bar = tqdm(
            total=self.config.total_steps, initial=self.num_timesteps, desc="PPO", unit="step", mininterval=1.0
        )

    def _on_rollout_start(self):
        # Between updates: policy and optimiser fit together here.
        if self.rollouts and self.rollouts % self.config.checkpoint_rollouts == 0:
            self.save()
        self.rollouts += 1

    def _on_step(self):
        self.bar.update(self.training_env.num_envs)
        limit = self.config.max_minutes
        return not limit or (time.monotonic() - self.started) / 60.0 < limit

    def _on_rollout_end(self):
        finished = self.training_env.finished
        for key in finished[-1] if finished else ():
            self.logger.record(f"episode/{key}", float(np.mean([episode[key] for episode in finished])))
        self.logger.record("time/minutes", self.minutes())
        if finished:
            recent = {key: np.mean([episode[key] for episode in finished]) for key in ("success", "ink_left", "return")}
            self.bar.set_postfix({key: f"{value:.2f}" for key, value in recent.items()}, refresh=False)
        self.logger.dump(self.num_timesteps)

    def _on_training_end(self):
        self.bar.close()

    def save(self):
        """Write the checkpoint."""
        policy = self.model.policy
        state = {
            "policy": policy.state_dict(),
            "optimiser": policy.optimizer.state_dict(),
            "steps": self.model.num_timesteps,
            "updates": self.model._n_updates,
            "random": random_state(),
            "minutes": self.minutes(),
            "config": plain(self.config),
        }
        save_checkpoint(self.out, state)
