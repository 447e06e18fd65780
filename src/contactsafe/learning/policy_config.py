"""Settings that all training of policies has in common, and what an algorithm must say of itself."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import tyro

from contactsafe.control import presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.parse import one_of
from contactsafe.policy.action_config import GAINS
from contactsafe.policy.conditions import Conditions
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.tasks import DEFAULT_TASK, TASKS, task_by_name
from contactsafe.tasks.base.registry import TASK_FORM

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from torch import nn

    from contactsafe.learning.vec_env import EncodedVecEnv

SESSION_FIELDS = (
    "encoder",
    "out",
    "resume",
    "total_steps",
    "max_minutes",
    "evaluate_episodes",
    "threads",
    "encoder_threads",
)
"""Settings that may change when a run goes on."""


@dataclass(frozen=True)
class PolicyConfig:
    """Settings that do not depend on the algorithm.

    An algorithm of Stable-Baselines3 is a subclass with its own settings, a name, `make_model` and `actor`, such as
    `PpoConfig`.

    Attributes:
        encoder: folder of the vision encoder that `contactsafe train vae` leaves (encoder.json, and encoder.onnx where
            it is learned); not read for a task without camera, and from Python empty for a policy that sees no images.
        out: folder of the run: checkpoint, TensorBoard log, and at its end a bundle.
        resume: go on from the checkpoint in out, as if the run had never stopped.
        task: what is learned; from Python, any name for the environments that are handed over.
        as_paper: configure the task as the paper words it, which has another reward. `for_task`, and so the command
            line, then trains as the paper does too: free-space controller, pose and latent alone, with an encoder of
            `contactsafe train vae --representation paper`.
        controller: preset underneath, as it is or with other values of parameters: `safe:tool_force_limit_n=12`.
        gains: who sets K1 and D1: the policy (learned), or nobody: K1 stays at the low end, in the middle or at the
            high end of its range, D1 is critical or the nearest that its range allows, and the policy has six actions
            in place of eighteen.
        gentleness: what the reward takes for force is multiplied by this; 0 for a reward that does not ask for
            gentle contacts.
        randomise: train on worlds that differ more than those of held-out episodes do, where the task has such.
        num_envs: environments side by side.
        total_steps: steps of the policy, over all environments and sessions.
        max_minutes: stop after this long in this session, keep a checkpoint and export what there is; 0 for no limit.
        rollout_steps: steps of each environment between two checkpoints and points of the curves; on-policy algorithms
            update the policy just as often.
        batch: samples in a gradient step.
        learning_rate: of Adam; falls linearly over total_steps, and stays at a twentieth.
        discount: the paper's γ of RL, for one environment step; raised to action_repeat.
        net: widths of the hidden layers, of policy and of value network.
        action_repeat: environment steps for which one action is given.
        dither: amplitude of the steady motion added to the actions, in training and ever after; 0 for none.
        reward_scale: rewards are multiplied by this before learning; logs are not.
        observes: vectors that the policy takes besides images, such as pose (the paper's), target (x_d, K1 and D1 as
            they are now) and force, each after a space; none for all that the task offers.
        rate_hz: of environment steps; for environments of one's own that are handed over.
        evaluate_episodes: held-out ones, at the end; 0 for none.
        seed: of weights, exploration and episodes.
        threads: torch's. More than one crawls as soon as anything else wants a core.
        encoder_threads: ONNX Runtime's.
        calibration: what `contactsafe identify` wrote of the robot; without it the task's arm is as described.
    """

    algorithm: ClassVar[str]

    encoder: Path | None = Path("runs/vae")
    out: Path = Path("runs/policy")
    resume: bool = False
    task: Annotated[str, one_of(TASKS, also=TASK_FORM)] = DEFAULT_TASK
    as_paper: bool = Conditions.as_paper
    controller: Annotated[str, one_of(presets.PRESETS, presets.by_name, presets.FORM)] = Conditions.controller
    gains: Annotated[str, one_of(GAINS)] = Conditions.gains
    gentleness: float = 1.0
    randomise: bool = True
    num_envs: int = 64
    total_steps: int = 1_500_000
    max_minutes: float = 0.0
    rollout_steps: int = 64
    batch: int = 512
    learning_rate: float = 3e-4
    discount: float = 0.995
    net: tuple[int, ...] = (256, 128)
    action_repeat: int = 1
    dither: float = 0.3
    reward_scale: float = 1.0
    observes: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ()
    rate_hz: tyro.conf.Suppress[float] = float(POLICY_RATE_HZ)
    evaluate_episodes: int = 64
    seed: int = 0
    threads: int = 1
    encoder_threads: int = 2
    calibration: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: none)")] = None

    def __post_init__(self) -> None:
        """Refuse numbers with which nothing can be trained."""
        for name in (
            "num_envs",
            "total_steps",
            "rollout_steps",
            "batch",
            "action_repeat",
            "threads",
            "encoder_threads",
        ):
            if getattr(self, name) < 1:
                raise InvalidInputError(f"{name} = {getattr(self, name)}; give 1 or more")
        for name in ("max_minutes", "evaluate_episodes", "seed", "gentleness"):
            if not getattr(self, name) >= 0:
                raise InvalidInputError(f"{name} = {getattr(self, name)}; give 0 or more")
        if len(set(self.observes)) < len(self.observes):
            raise InvalidInputError(f"observes = {self.observes}; give each vector once")
        if not 0.0 < self.discount <= 1.0:
            raise InvalidInputError(f"discount = {self.discount}; give more than 0, at most 1")

    @classmethod
    def for_task(cls, task: str, as_paper: bool = False, **settings: Any) -> Self:
        """Return the settings with which a task is learned unless told otherwise.

        Args:
            task: by name.
            as_paper: as the paper words them.
            settings: that are told.

        Raises:
            InvalidInputError: no task has this name; the paper has no such task.
        """
        own = task_by_name(task).settings_of(cls.algorithm, as_paper)
        return cls(**{**own, "task": task, "as_paper": as_paper, **settings})

    @property
    def conditions(self) -> Conditions:
        """What the policy is to be run with, too."""
        return Conditions(self.controller, self.gains, self.as_paper)

    def make_model(self, env: "EncodedVecEnv") -> "BaseAlgorithm":
        """Make an untrained model of Stable-Baselines3, on the CPU, seeded.

        Args:
            env: what it learns in.
        """
        raise NotImplementedError

    def actor(self, model: "BaseAlgorithm") -> "nn.Module":
        """Return the part of a model that acts without exploring: a torch module, (N, observation) to (N, 18).

        Actions are clipped to [-1, 1] by who uses it.
        """
        raise NotImplementedError

    def prepare_rollout(self, model: "BaseAlgorithm") -> None:
        """Set what changes with the steps done, before a rollout; nothing by default.

        Args:
            model: as `make_model` returned it; its `num_timesteps` say how far it is.
        """

    def falling_rate(self) -> Callable[[float], float]:
        """Return the learning rate over the fraction of total_steps that is left: a resumed run has the same."""
        return lambda remaining: self.learning_rate * max(remaining, 0.05)
