"""The insertion task as the experiments see it: holes to be found, things moved into the arm, pushes while it works."""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from contactsafe.policy.action import DOWN
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.results.figures import Panel
from contactsafe.results.metrics import Aim, Highlight, Metric
from contactsafe.results.recording import level_rectangle
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm, Pose
from contactsafe.robot.calibrated import arm_for
from contactsafe.robot.calibration import Calibration
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.obstacles import Obstacle
from contactsafe.tasks.base.episodes import TaskEpisodes
from contactsafe.tasks.base.scenes import TaskScenes
from contactsafe.tasks.base.scripted import hold_still
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.insertion.scene import BLOCK_HALF, PEG
from contactsafe.tasks.insertion.tasks import InsertionTasks

HOLE = 1
"""Value of a cell of the block's upper face that is open."""

COMES_FROM_M, GOES_ON_M = 0.12, 0.03
"""How far beside the forearm an obstacle sets off, and how far it would go on beyond where it meets it, m."""

COMES_S = (0.5, 2.5)
"""When it sets off and arrives, s."""

_CELL_M = 0.001
_ABOVE_M = 0.004  # of the block, while the tool rests
_DOWN_S = 2.0  # time in which the script pushes the peg in
_MIDDLES = np.arange(-BLOCK_HALF + _CELL_M / 2, BLOCK_HALF, _CELL_M)


class InsertionEpisodes(TaskEpisodes):
    """Held-out holes, one a seed."""

    tasks: InsertionTasks

    def curves(self) -> Mapping[str, np.ndarray]:
        """Return how deep the pegs are, m, (n,)."""
        return {"depth": self.tasks.tasks["depth"].copy()}

    def pictures(self) -> np.ndarray:
        """Return the blocks' upper faces with their holes where they truly are, uint8 (n, rows, columns)."""
        away = self.tasks.tasks["mouth"][:, :2] - np.array(self.tasks.config.mouth[:2])
        x, y = (_MIDDLES - away[:, k, None] for k in (0, 1))
        open_ = x[:, :, None] ** 2 + y[:, None, :] ** 2 < self.tasks.hole_radius**2
        return np.where(open_, HOLE, 0).astype(np.uint8)

    def worth_showing(self) -> np.ndarray:
        """Return how far each hole is from where it is believed to be, m, (n,): the further, the longer the search."""
        return np.linalg.norm(self.tasks.tasks["mouth"] - self.tasks.tasks["believed"], axis=1)


class Insertion(TaskScenes[InsertionTasks, InsertionConfig]):
    """The insertion task for `contactsafe.experiments.task.ExperimentTask`.

    Args:
        config: of the task, as the policy has learned it; the controllers that are compared stand in for its own.
        arm: that works; None for a Panda with a peg.
    """

    tasks_type = InsertionTasks
    name = "inserting"
    policy = "A learned policy puts a peg into a hole that it must find by touch, with a simulated Franka Panda."
    metrics: tuple[Metric, ...] = (
        Metric("inserted", "pegs inserted, mean", "%", 100.0, main=True, aim=Aim(at_least=90.0), mean=True),
        Metric("depth_mm", "depth reached", "mm"),
        Metric("time_s", "time to full depth", "s", main=True),
    )
    aims: Mapping[str, Aim] = MappingProxyType(
        {
            "tool_force_peak_n": Aim(at_most=40.0, always=True),
            "tool_force_median_n": Aim(at_most=15.0),
        }
    )
    highlights: tuple[Highlight, ...] = (Highlight("inserting", "inserted", "Pegs inserted, holes never met before"),)
    panels: tuple[Panel, ...] = (Panel("depth", "mm", lambda run: 1000.0 * run.curves["depth"]),)

    def __init__(self, config: InsertionConfig | None = None, arm: Arm | Calibration | None = None):
        config = config or InsertionConfig()
        face = level_rectangle(config.mouth, (2 * BLOCK_HALF, 2 * BLOCK_HALF))
        super().__init__(config, arm_for(arm, lambda: robots.panda(PEG)), face, {HOLE: (20, 20, 20)})

    def episodes(self, controller: str, seeds: Sequence[int]) -> InsertionEpisodes:
        """Return held-out holes."""
        return InsertionEpisodes(self.make_tasks(self.under(controller), seeds), seeds)

    def towards_obstacle(
        self, controller: str, seeds: Sequence[int], obstacle_at: Callable[[Arm, np.ndarray], Obstacle]
    ) -> InsertionEpisodes:
        """Return holes, and an obstacle that is moved into the forearm while the peg goes in: the arm itself stays."""
        probe = InsertionTasks(self.config, arm=self.arm)
        posture = probe.posture_over(Pose(np.array(probe.config.mouth), DOWN))
        obstacle = obstacle_at(probe.arm, posture)
        x, y, z = obstacle.position
        travel = (0.0, COMES_FROM_M + GOES_ON_M, 0.0)
        coming = replace(obstacle, position=(x, y - COMES_FROM_M, z), travel=travel, travel_s=COMES_S)
        worlds = [self.with_obstacle(coming)] * len(seeds)
        return InsertionEpisodes(self.make_tasks(self.under(controller), seeds, worlds), seeds)

    def scripted(
        self,
        controller: str,
        seeds: Sequence[int],
        worlds: Sequence[WorldConfig],
        stiffness: Sequence[float],
        works: bool,
    ) -> tuple[InsertionEpisodes, Callable[[dict[str, np.ndarray]], np.ndarray]]:
        """Return holes where they are believed to be, and a script: straight in, or nothing just above the block."""
        action = self.steady_action(stiffness)
        config = replace(self.under(controller), action=action, error_m=0.0, tilt_rad=0.0)
        tasks = self.make_tasks(config, seeds, [self.with_errors_of(world) for world in worlds])
        begin = functools.partial(InsertionTasks.reset, height=_ABOVE_M)
        return InsertionEpisodes(tasks, seeds, begin), straight_in(config) if works else hold_still

    def outcome(self, trace: np.ndarray, curves: Mapping[str, np.ndarray], succeeded: bool) -> dict[str, float]:
        """Return whether the peg is in, how deep, and how long that took."""
        return {
            "inserted": float(succeeded),
            "depth_mm": float(1000.0 * curves["depth"].max()),
            "time_s": float(trace["time"][-1]) if succeeded else float("nan"),
        }


def straight_in(config: InsertionConfig) -> Callable[[dict[str, np.ndarray]], np.ndarray]:
    """Return a script that goes straight down into the hole, to its full depth."""
    down = (_ABOVE_M + config.depth_m) / (POLICY_RATE_HZ * _DOWN_S) / config.action.translation[2]

    def act(observation: dict[str, np.ndarray]) -> np.ndarray:
        actions = hold_still(observation)
        actions[:, 2] = np.where(observation["offset"][:, 2] > -config.depth_m, -down, 0.0)
        return actions

    return act
