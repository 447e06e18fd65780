"""The algorithms by name: PPO and SAC of Stable-Baselines3. All that training knows of them is in this file."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, cast

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from contactsafe.core.errors import InvalidInputError
from contactsafe.learning.policy_config import PolicyConfig
from contactsafe.learning.vec_env import EncodedVecEnv


@dataclass(frozen=True)
class PpoConfig(PolicyConfig):
    """Settings of PPO (Schulman et al. 2017), the paper's algorithm.

    Attributes:
        epochs: passes over a rollout.
        gae_lambda: of the advantage estimate.
        clip_range: the paper's ε.
        entropy_weight: bonus on the entropy of the action distribution.
        value_weight: weight of the value loss.
        max_grad_norm: gradients are clipped to this.
        target_kl: an update stops early when the policy moved further than this.
        log_std_init: log of the first standard deviation of each action.
        log_std_final: of the last; between them it falls linearly. The bundle acts by the mean alone, so the mean must
            learn to do without noise.
    """

    algorithm: ClassVar[str] = "ppo"

    out: Path = Path("runs/ppo")
    batch: int = 1024
    learning_rate: float = 5e-4
    epochs: int = 5
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    entropy_weight: float = 0.0
    value_weight: float = 0.5
    max_grad_norm: float = 0.5
    target_kl: float = 0.03
    log_std_init: float = -1.0
    log_std_final: float = -1.7

    def make_model(self, env: EncodedVecEnv) -> PPO:
        """Make an untrained PPO."""
        return PPO(
            "MlpPolicy",
            env,
            learning_rate=self.falling_rate(),
            n_steps=self.rollout_steps,
            batch_size=min(self.batch, self.num_envs * self.rollout_steps),
            n_epochs=self.epochs,
            gamma=self.discount**self.action_repeat,
            gae_lambda=self.gae_lambda,
            clip_range=self.clip_range,
            ent_coef=self.entropy_weight,
            vf_coef=self.value_weight,
            max_grad_norm=self.max_grad_norm,
            target_kl=self.target_kl,
            policy_kwargs={
                "net_arch": {"pi": list(self.net), "vf": list(self.net)},
                "activation_fn": nn.Tanh,
                "log_std_init": self.log_std_init,
            },
            seed=self.seed,
            device="cpu",
        )

    def prepare_rollout(self, model: BaseAlgorithm) -> None:
        """Let exploration fall with the steps done."""
        done = min(model.num_timesteps / self.total_steps, 1.0)
        with torch.no_grad():
            _policy_of(model).log_std.fill_(self.log_std_init + done * (self.log_std_final - self.log_std_init))

    def actor(self, model: BaseAlgorithm) -> nn.Module:
        """Return the mean of the action distribution."""
        policy = _policy_of(model)
        return nn.Sequential(policy.mlp_extractor.policy_net, policy.action_net)


def _policy_of(model: BaseAlgorithm) -> ActorCriticPolicy:
    return cast(ActorCriticPolicy, model.policy)


@dataclass(frozen=True)
class SacConfig(PolicyConfig):
    """Settings of SAC (Haarnoja et al. 2018).

    Attributes:
        buffer: transitions remembered, over all environments; 1.2 kB each in memory, and as much on disk.
        learning_starts: steps with random actions before the first update.
        update_every: steps of each environment between updates.
        gradient_steps: gradient steps of an update.
        target_fraction: of the difference by which the target networks move towards the critics in a gradient step.
        entropy_start: first weight of the entropy; it is then tuned to an entropy of minus the number of actions. It
            falls slowly: what is far above a step's reward, of some hundredths, is all that counts for long.
    """

    algorithm: ClassVar[str] = "sac"

    out: Path = Path("runs/sac")
    num_envs: int = 32
    total_steps: int = 80_000
    rollout_steps: int = 128
    batch: int = 256
    net: tuple[int, ...] = (128, 128)
    action_repeat: int = 4
    buffer: int = 300_000
    learning_starts: int = 10_000
    update_every: int = 1
    gradient_steps: int = 4
    target_fraction: float = 0.005
    entropy_start: float = 0.005

    def __post_init__(self) -> None:
        """Refuse a memory that is gone before it is saved."""
        super().__post_init__()
        least = 2 * self.num_envs * max(self.rollout_steps, self.update_every)
        if self.buffer < least:
            raise InvalidInputError(f"buffer = {self.buffer}; give {least} or more: two rollouts of every environment")
        for name in ("update_every", "gradient_steps"):
            if getattr(self, name) < 1:
                raise InvalidInputError(f"{name} = {getattr(self, name)}; give 1 or more")

    def make_model(self, env: EncodedVecEnv) -> SAC:
        """Make an untrained SAC."""
        return SAC(
            "MlpPolicy",
            env,
            learning_rate=self.falling_rate(),
            buffer_size=self.buffer,
            learning_starts=self.learning_starts,
            batch_size=self.batch,
            tau=self.target_fraction,
            gamma=self.discount**self.action_repeat,
            train_freq=self.update_every,
            gradient_steps=self.gradient_steps,
            ent_coef=f"auto_{self.entropy_start}",
            policy_kwargs={"net_arch": list(self.net)},
            seed=self.seed,
            device="cpu",
        )

    def actor(self, model: BaseAlgorithm) -> nn.Module:
        """Return the squashed mean of the action distribution."""
        actor = cast(SAC, model).actor
        return nn.Sequential(actor.latent_pi, actor.mu, nn.Tanh())


ALGORITHMS = {config.algorithm: config for config in (PpoConfig, SacConfig)}
"""Settings by name of the algorithm, as the command line offers them."""
