"""Settings that every way of training a policy shares, and what an algorithm must say of itself."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.parse import one_of, some_of
from contactsafe.policy.observation import SCALES
from contactsafe.tasks import ENGINES

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
        encoder: folder of the vision encoder that `contactsafe train vae` leaves (encoder.json, and encoder.onnx where it is
            learned).
        out: folder of the run: checkpoint, TensorBoard log, and at its end a bundle.
        resume: go on from the checkpoint in out, as if the run had never stopped.
        env_id: Gymnasium id of the task; from Python, any that gives the same observations.
        randomise: train on worlds that differ from episode to episode; held-out boards are wiped in the nominal one.
        num_envs: environments side by side.
        total_steps: steps of the policy, over all environments and sessions.
        max_minutes: stop after this long in this session, keep a checkpoint and export what there is; 0 for no limit.
        rollout_steps: steps of each environment between two checkpoints and points of the curves; on-policy algorithms
            update the policy just as often.
        batch: samples in a gradient step.
        learning_rate: of Adam; falls linearly to a twentieth over total_steps.
        discount: the paper's γ of RL, for one environment step; raised to action_repeat.
        net: widths of the hidden layers, of policy and of value network.
        action_repeat: environment steps for which one action is given.
        dither: amplitude of the steady motion laid over the actions, in training and ever after; 0 for none.
        reward_scale: rewards are multiplied by this before learning; logs are not.
        observes: what the policy takes besides the picture: pose (the paper's), target (x_d, K1 and D1 as they are
            now) and force; without the latter two it can neither know how stiff it is nor feel what it touches.
        rate_hz: of environment steps.
        evaluate_episodes: on boards never trained on, at the end; 0 for none.
        seed: of weights, exploration and boards.
        threads: torch's. More than one crawls as soon as anything else wants a core.
        encoder_threads: ONNX Runtime's.
    """

    algorithm: ClassVar[str]

    encoder: Path = Path("runs/vae")
    out: Path = Path("runs/policy")
    resume: bool = False
    env_id: Annotated[str, one_of(ENGINES.values())] = "contactsafe/Wiping-v0"
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
    observes: Annotated[tuple[str, ...], some_of(SCALES, " ")] = ("pose", "target", "force")
    rate_hz: float = 60.0
    evaluate_episodes: int = 64
    seed: int = 0
    threads: int = 1
    encoder_threads: int = 2

    def __post_init__(self):
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
        for name in ("max_minutes", "evaluate_episodes", "seed"):
            if not getattr(self, name) >= 0:
                raise InvalidInputError(f"{name} = {getattr(self, name)}; give 0 or more")
        unknown = [name for name in self.observes if name not in SCALES]
        if unknown or len(set(self.observes)) < len(self.observes):
            raise InvalidInputError(f"observes = {self.observes}; give some of {', '.join(SCALES)}, each once")
        if not 0.0 < self.discount <= 1.0:
            raise InvalidInputError(f"discount = {self.discount}; give more than 0, at most 1")

    def make_model(self, env: Any) -> Any:
        """Make an untrained model of Stable-Baselines3, on the CPU, seeded.

        Args:
            env: the EncodedVecEnv.
        """
        raise NotImplementedError

    def actor(self, model: Any) -> Any:
        """Give the part of a model that acts without exploring: a torch module, (N, observation) to (N, 18).

        Actions are clipped to [-1, 1] by who uses it.
        """
        raise NotImplementedError

    def prepare_rollout(self, model: Any) -> None:
        """Set what changes with the steps done, before a rollout; nothing by default.

        Args:
            model: as `make_model` gave it; its `num_timesteps` say how far it is.
        """

    def falling_rate(self) -> Callable[[float], float]:
        """Give the learning rate by the share of total_steps still ahead: absolute, so a resumed run has the same."""
        return lambda remaining: self.learning_rate * max(remaining, 0.05)
