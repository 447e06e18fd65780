"""What every experiment can be told."""

from dataclasses import dataclass

from contactsafe.control import presets
from contactsafe.errors import InvalidInputError

BATCH = 16
"""Most trials stepped together: bounds the memory that their traces take."""


@dataclass(frozen=True)
class ExperimentConfig:
    """Which controllers, how often, from which seed.

    Attributes:
        controllers: presets by name, in the order they are reported.
        trials: seeds tried, seed, seed + 1, …
        seed: first seed.
    """

    controllers: tuple[str, ...] = ("vices", "paper", "safe")
    trials: int = 10
    seed: int = 0

    def __post_init__(self):
        """Refuse unknown controllers and empty experiments."""
        if not self.controllers:
            raise InvalidInputError(f"no controller given; choose from {', '.join(presets.PRESETS)}")
        for name in self.controllers:
            presets.by_name(name)
        if self.trials < 1:
            raise InvalidInputError(f"trials = {self.trials}; give 1 or more")
        if self.seed < 0:
            raise InvalidInputError(f"seed = {self.seed}; give 0 or more")

    def batches(self) -> list[range]:
        """Give the seeds in batches that are stepped together."""
        stop = self.seed + self.trials
        return [range(first, min(first + BATCH, stop)) for first in range(self.seed, stop, BATCH)]
