"""Under which conditions a policy was trained, as far as they are to be the same when it is run."""

from dataclasses import dataclass

from contactsafe.control import presets
from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.policy.action_config import GAINS, LEARNED_GAINS


@dataclass(frozen=True)
class Conditions:
    """What belongs to a policy beside its networks: a bundle holds it, and evaluation and experiments keep to it.

    Attributes:
        controller: preset that it was trained over, as `presets.by_name` takes it; evaluation takes it where no other
            is named.
        gains: who sets K1 and D1, see `ActionConfig`.
        as_paper: whether the task is configured as the paper words it.
    """

    controller: str = "safe"
    gains: str = LEARNED_GAINS
    as_paper: bool = False

    def __post_init__(self) -> None:
        """Refuse names that are unknown."""
        if not isinstance(self.controller, str):
            raise InvalidInputError(f"controller = {shown(self.controller)}; choose from {', '.join(presets.PRESETS)}")
        presets.by_name(self.controller)
        if not isinstance(self.gains, str) or self.gains not in GAINS:
            raise InvalidInputError(f"gains = {shown(self.gains)}; choose from {', '.join(GAINS)}")
        if not isinstance(self.as_paper, bool):
            raise InvalidInputError(f"as_paper = {shown(self.as_paper)}; give true or false")
