"""Held-out episodes of a task, as the experiments run them: one a seed, begun and stepped together."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.robot.arm import Arm
from contactsafe.sim.worlds import Worlds
from contactsafe.tasks.base.evaluation import HELD_OUT_SEED
from contactsafe.tasks.base.tasks import Tasks

Begin = Callable[[Any, int, np.random.Generator], None]
"""Begins one task's episode from its generator."""


def held_out(seed: int) -> np.random.Generator:
    """Return the generator of an episode: none that training has sampled from."""
    return np.random.default_rng(HELD_OUT_SEED + seed)


class TaskEpisodes(Independent):
    """What `contactsafe.experiments.task.Episodes` asks for; a task adds its curves and pictures.

    Args:
        tasks: that run them.
        seeds: of the episodes.
        begin: begins one of them; `Tasks.reset` where None.
        rngs: of the episodes; what was sampled from them before is not sampled again.
    """

    def __init__(
        self,
        tasks: Tasks,
        seeds: Sequence[int],
        begin: Begin | None = None,
        rngs: Sequence[np.random.Generator] | None = None,
    ):
        self.tasks, self.seeds = tasks, seeds
        self._begin: Begin = begin or Tasks.reset
        self.begin(rngs)

    def begin(self, rngs: Sequence[np.random.Generator] | None = None) -> None:
        """Begin all of them."""
        for i, rng in enumerate(rngs or [held_out(seed) for seed in self.seeds]):
            self._begin(self.tasks, i, rng)

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.tasks.arm

    @property
    def worlds(self) -> Worlds:
        """The simulation below."""
        return self.tasks.worlds

    @property
    def step_limit(self) -> int:
        """Policy steps of an episode."""
        return self.tasks.step_limit

    @property
    def terminated(self) -> np.ndarray:
        """Whether each is over before its time, (n,)."""
        return self.tasks.terminated

    @property
    def succeeded(self) -> np.ndarray:
        """Whether each has reached its goal, (n,)."""
        return self.tasks.tasks["success"] == 1

    @property
    def camera_homography(self) -> np.ndarray | None:
        """Plane coordinates (x, y, 1), m, to pixels (u, v, w) of the task's camera, (3, 3); None without one."""
        return self.tasks.camera_homography

    def observation(self) -> dict[str, np.ndarray]:
        """Return what the policies see."""
        return self.tasks.observation()

    def step(self, actions: np.ndarray, traces: np.ndarray | None = None) -> None:
        """Run one policy step in each."""
        self.tasks.step(actions, traces)

    def curves(self) -> Mapping[str, np.ndarray]:
        """Return what the task records beside the trace, (n,) each: nothing."""
        return {}

    def pictures(self) -> np.ndarray:
        """Return what lies on the stage's surface, uint8 (n, rows, columns): one empty cell."""
        return np.zeros((self.worlds.n, 1, 1), np.uint8)

    def timed(self) -> Mapping[str, tuple[Callable[[], object], int]]:
        """Return what of a step is worth timing by itself: nothing."""
        return {}

    def worth_showing(self) -> np.ndarray:
        """Return how much there is to see in each, (n,): in one as much as in another."""
        return np.zeros(self.worlds.n)
