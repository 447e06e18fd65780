"""What every experiment can be told."""

import math
from dataclasses import dataclass

from contactsafe.control import presets
from contactsafe.core.errors import InvalidInputError

BATCH = 16
"""Most trials stepped together: bounds the memory that their traces take."""

PLANTS = ("real", "clean")
"""The arm and its sensors with errors drawn at random, or just as the controller's model has them."""


@dataclass(frozen=True)
class ExperimentConfig:
    """Which controllers, how often, from which seed.

    Attributes:
        controllers: presets by name, in the order they are reported.
        trials: seeds tried, seed, seed + 1, …
        seed: first seed.
        plants: some of `PLANTS`, for collisions.
        minutes: simulated time in which detection counts false alarms, min.
    """

    controllers: tuple[str, ...] = ("vices", "paper", "safe")
    trials: int = 10
    seed: int = 0
    plants: tuple[str, ...] = PLANTS
    minutes: float = 60.0

    def __post_init__(self):
        """Refuse unknown controllers and empty experiments."""
        if not self.controllers:
            raise InvalidInputError(f"no controller given; choose from {', '.join(presets.PRESETS)}")
        for name in self.controllers:
            presets.by_name(name)
        if len(set(self.controllers)) < len(self.controllers):
            raise InvalidInputError(f"controllers = {','.join(self.controllers)}; give each once")
        if self.trials < 1:
            raise InvalidInputError(f"trials = {self.trials}; give 1 or more")
        if self.seed < 0:
            raise InvalidInputError(f"seed = {self.seed}; give 0 or more")
        if not self.plants or not set(self.plants) <= set(PLANTS):
            raise InvalidInputError(f"plants = {','.join(self.plants)}; choose from {', '.join(PLANTS)}")
        if not 0 < self.minutes < math.inf:
            raise InvalidInputError(f"minutes = {self.minutes:g}; give a number greater than 0")

    @property
    def seeds(self) -> range:
        """All seeds, in order."""
        return range(self.seed, self.seed + self.trials)

    def batches(self) -> list[range]:
        """Give the seeds in batches that are stepped together."""
        return [self.seeds[first : first + BATCH] for first in range(0, self.trials, BATCH)]
