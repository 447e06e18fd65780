"""What the paper's experiments ask of a task; `contactsafe.tasks` holds those that answer."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np

from contactsafe.results.figures import Panel
from contactsafe.results.metrics import Aim, Highlight, Metric
from contactsafe.results.recording import Stage
from contactsafe.robot.arm import Arm
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.obstacles import Obstacle
from contactsafe.sim.worlds import Worlds

Act = Callable[[dict[str, np.ndarray]], np.ndarray]
"""From a batch of observations to actions, (n, 18)."""

ObstacleAt = Callable[[Arm, np.ndarray], Obstacle]
"""From an arm and its joint positions, (n,) rad, to the obstacle that it meets there."""


class Episodes(Protocol):
    """N episodes of a task, begun and stepped together."""

    @property
    def arm(self) -> Arm:
        """The arm that all of them have."""
        ...

    @property
    def worlds(self) -> Worlds:
        """The simulation below."""
        ...

    @property
    def step_limit(self) -> int:
        """Policy steps of an episode."""
        ...

    @property
    def terminated(self) -> np.ndarray:
        """Whether each is over before its time, (n,)."""
        ...

    @property
    def succeeded(self) -> np.ndarray:
        """Whether each has reached its goal, (n,)."""
        ...

    @property
    def camera_homography(self) -> np.ndarray | None:
        """What a policy needs to know of the camera, (3, 3); None without one."""
        ...

    def begin(self) -> None:
        """Begin all of them, as their seeds say."""
        ...

    def observation(self) -> dict[str, np.ndarray]:
        """Return what the policies see, a batch."""
        ...

    def step(self, actions: np.ndarray, traces: np.ndarray | None = None) -> None:
        """Run one policy step in each.

        Args:
            actions: (n, 18).
            traces: `trace_dtype` records to fill, (n, MAX_TICKS).
        """
        ...

    def curves(self) -> Mapping[str, np.ndarray]:
        """Return what the task records beside the trace, one value each, by name, (n,)."""
        ...

    def pictures(self) -> np.ndarray:
        """Return what lies on the stage's surface, uint8 (n, rows, columns), copied."""
        ...

    def timed(self) -> Mapping[str, tuple[Callable[[], object], int]]:
        """Return what of an episode's step is worth timing by itself: by name, what runs it, and how many times."""
        ...

    def worth_showing(self) -> np.ndarray:
        """Return how much there is to see in each, as it begins, (n,), 0 or more: the first of the largest is shown."""
        ...


class ExperimentTask(Protocol):
    """A task as experiments see it: episodes begun as they need them, and declarations of what to show.

    Attributes:
        name: what the tool does, as in "push on link 4 while NAME".
        policy: what the learned policy does, in a sentence.
        metrics: of an episode's outcome.
        aims: what metrics of the tool's force should be, by name of `contactsafe.experiments.task_safety.METRICS`.
        highlights: of its metrics, for scenarios named `name`.
        panels: of its curves, plotted beside the tool's force.
        stage: on which it is filmed.
        arm: that works.
    """

    name: str
    policy: str
    metrics: tuple[Metric, ...]
    aims: Mapping[str, Aim]
    highlights: tuple[Highlight, ...]
    panels: tuple[Panel, ...]
    stage: Stage
    arm: Arm

    def episodes(self, controller: str, seeds: Sequence[int]) -> Episodes:
        """Return held-out episodes, begun."""
        ...

    def towards_obstacle(self, controller: str, seeds: Sequence[int], obstacle_at: ObstacleAt) -> Episodes:
        """Return held-out episodes, begun, in which the policy leads the forearm into an obstacle."""
        ...

    def scripted(
        self,
        controller: str,
        seeds: Sequence[int],
        worlds: Sequence[WorldConfig],
        stiffness: Sequence[float],
        works: bool,
    ) -> tuple[Episodes, Act]:
        """Return held-out episodes, begun, and a script that does the task's motion in place of a policy.

        Args:
            controller: preset by name.
            seeds: of the episodes.
            worlds: plant and sensors of each.
            stiffness: K1 throughout, (6,), 1/s².
            works: whether the tool works, or holds still nearby.
        """
        ...

    def outcome(self, trace: np.ndarray, curves: Mapping[str, np.ndarray], succeeded: bool) -> dict[str, float]:
        """Return the task's own metrics of one episode.

        Args:
            trace: `trace_dtype` records, (T,).
            curves: what `Episodes.curves` gave, one value a tick, (T,).
            succeeded: whether it ended at its goal.
        """
        ...
