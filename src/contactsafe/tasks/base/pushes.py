"""Pushes on the arm, scheduled at random while it works: for tests of what the controller shields the task from."""

from dataclasses import dataclass

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm
from contactsafe.sim.worlds import TICK_S, Worlds

Range = tuple[float, float]


@dataclass(frozen=True)
class Pushes:
    """Pushes one after the other; each is sampled evenly from the ranges.

    Attributes:
        force_n: N, in any direction.
        lasting_s: how long, s.
        pause_s: between the end of one and the start of the next, s.
        links: which ones are pushed; None for the third to the last but one.
    """

    force_n: Range = (5.0, 25.0)
    lasting_s: Range = (0.3, 1.0)
    pause_s: Range = (0.5, 2.0)
    links: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        """Refuse pushes that cannot be."""
        for name in ("force_n", "lasting_s", "pause_s"):
            low, high = getattr(self, name)
            if not 0.0 <= low <= high < np.inf:
                raise InvalidInputError(f"pushes {name} = ({low}, {high}); give (low, high) with 0 ≤ low ≤ high")
        if self.links is not None and not (self.links and all(link >= 1 for link in self.links)):
            raise InvalidInputError(f"pushes links = {self.links}; give numbers from 1 on, or None for the middle ones")

    def links_of(self, arm: Arm) -> tuple[int, ...]:
        """Return the links of an arm that are pushed.

        Raises:
            InvalidInputError: the arm has no such link.
        """
        if self.links is None:
            return tuple(range(3, arm.n)) or (arm.n,)
        if max(self.links) > arm.n:
            raise InvalidInputError(f"pushes links = {self.links}; arm '{arm.name}' has {arm.n}, give some of those")
        return self.links


class PushSchedule(Independent):
    """Schedules pushes on the arms of some worlds.

    Args:
        worlds: whose arms.
        pushes: ranges that they are sampled from.

    Attributes:
        rngs: the generator of each world's episode.

    Raises:
        InvalidInputError: the arm has no such link.
    """

    def __init__(self, worlds: Worlds, pushes: Pushes):
        self._worlds, self._pushes, self._links = worlds, pushes, pushes.links_of(worlds.arm)
        self.rngs = [np.random.default_rng(0) for _ in range(worlds.n)]

    def begin(self, i: int, rng: np.random.Generator) -> None:
        """Begin world i's episode, after its reset."""
        self.rngs[i] = np.random.default_rng(rng.integers(2**63))
        self._next(i)

    def step(self) -> None:
        """Plan the next push wherever the last is over; call it before every policy step."""
        records = self._worlds.records
        for i in np.flatnonzero(records["tick"] >= records["push"]["stop"]).tolist():
            self._next(i)

    def _next(self, i: int) -> None:
        rng, pushes = self.rngs[i], self._pushes
        direction = rng.normal(size=3)
        force = rng.uniform(*pushes.force_n) * direction / np.linalg.norm(direction)
        start = int(self._worlds.records[i]["tick"]) * TICK_S + rng.uniform(*pushes.pause_s)
        stop = start + rng.uniform(*pushes.lasting_s)
        self._worlds.push(i, f"link{rng.choice(self._links)}", (0.0, 0.0, 0.0), force, start, stop)
