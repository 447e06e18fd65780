"""What every task can be told."""

from dataclasses import dataclass, field

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.action_config import ActionConfig
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.sim.config import WorldConfig
from contactsafe.tasks.base.pushes import Pushes


@dataclass(frozen=True)
class TaskConfig:
    """Settings that all tasks have; a task's own configuration extends them.

    Attributes:
        episode_s: time limit, s.
        controller: preset by name; the free-space law is 'vices'.
        pushes: on the arm while it works; None for none.
        world: plant, sensors, obstacles.
        action: how far actions move the target, and its bounds.
    """

    episode_s: float = 20.0
    controller: str = "safe"
    pushes: Pushes | None = None
    world: WorldConfig = field(default_factory=WorldConfig)
    action: ActionConfig = field(default_factory=ActionConfig)

    def __post_init__(self) -> None:
        """Refuse a time limit that cannot be."""
        if not isinstance(self.episode_s, int | float) or not 1 / POLICY_RATE_HZ <= self.episode_s <= 86400:
            raise InvalidInputError(
                f"episode_s = {self.episode_s!r}; give seconds, from 1/{POLICY_RATE_HZ} to 86400, a day"
            )
