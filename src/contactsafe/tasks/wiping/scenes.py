"""The wiping task as the experiments see it: boards to wipe, a lure beside an obstacle, strokes under pushes."""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.action import DOWN
from contactsafe.policy.action_config import ActionConfig
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
from contactsafe.tasks.base.episodes import TaskEpisodes, held_out
from contactsafe.tasks.base.scenes import TaskScenes
from contactsafe.tasks.base.scripted import hold_still
from contactsafe.tasks.wiping.camera import render_mask_into
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.tasks import WipingTasks
from contactsafe.tasks.wiping.whiteboard import INK, OBJECT

LURE_AT, LURE_SIZE = (0.0, -0.24), (0.10, 0.06)
"""A dark object on the right of the board, unknown to the policy, which takes it for ink; from its centre, m."""

OBSTACLE_AT = (-0.12, -0.06)
"""Range of the tool's y at which the forearm meets the obstacle, from the board's centre, m."""

_HOLD_HEIGHT = 0.06  # m above the board
_PRESS = 0.004  # depth of x_d below the board while wiping, m
_ABOVE = 0.001  # start of the strokes above the board, m
_STROKE, _PERIOD_S = 0.08, 5.0  # half length, m, and period, s, of the strokes


class WipingEpisodes(TaskEpisodes):
    """Held-out boards, one a seed."""

    tasks: WipingTasks

    def curves(self) -> Mapping[str, np.ndarray]:
        """Return the fraction of the ink that is left, (n,)."""
        return {"ink_left": self.tasks.info()["ink_left"]}

    def pictures(self) -> np.ndarray:
        """Return the boards' cells, uint8 (n, rows, columns), copied."""
        return self.tasks.boards.cells.copy()

    def worth_showing(self) -> np.ndarray:
        """Return the cells of ink, (n,): a board that one stroke wipes shows little."""
        return np.count_nonzero(self.tasks.boards.cells, axis=(1, 2))

    def timed(self) -> Mapping[str, tuple[Callable[[], object], int]]:
        """Return what is worth timing by itself: the mask."""
        boards, plant = self.tasks.boards, self.worlds.records[0]["plant"]
        size = boards.masks.shape[1]

        def mask() -> None:
            render_mask_into(boards.camera, boards.ink_index.shown[0], plant, boards.masks[0])

        return {f"mask, {size} × {size}": (mask, 50)}


class Wiping(TaskScenes[WipingTasks, WipingConfig]):
    """The wiping task for `contactsafe.experiments.task.ExperimentTask`.

    Args:
        config: of the task, as the policy has learned it; the controllers that are compared stand in for its own.
        arm: that works; None for a Panda with a wiper.
    """

    tasks_type = WipingTasks
    name = "wiping"
    policy = "A learned policy wipes ink off a whiteboard with a simulated Franka Panda."
    metrics: tuple[Metric, ...] = (
        Metric(
            "ink_removed", "ink removed, mean", "%", 100.0, main=True,
            aim=Aim(at_least=80.0, ratio_at_least=0.95), mean=True,
        ),
        Metric("clean", "boards wiped clean, mean", "%", 100.0, main=True, mean=True),
        Metric("time_s", "time to a clean board", "s"),
    )  # fmt: skip
    aims: Mapping[str, Aim] = MappingProxyType(
        {
            "tool_force_peak_n": Aim(at_most=40.0, always=True),  # the paper's
            "tool_force_median_n": Aim(at_most=10.0, at_least=2.0),
            "landing_peak_n": Aim(at_most=20.0),
        }
    )
    highlights: tuple[Highlight, ...] = (Highlight("wiping", "ink_removed", "Ink wiped off boards never seen before"),)
    panels: tuple[Panel, ...] = (Panel("ink left", "%", lambda run: 100.0 * run.curves["ink_left"]),)

    def __init__(self, config: WipingConfig | None = None, arm: Arm | Calibration | None = None):
        config = config or WipingConfig()
        board = level_rectangle(config.board.centre, config.board.size)
        super().__init__(config, arm_for(arm, robots.panda), board, {INK: (24, 48, 104), OBJECT: (20, 20, 22)})

    def episodes(self, controller: str, seeds: Sequence[int]) -> WipingEpisodes:
        """Return held-out boards."""
        return WipingEpisodes(self.make_tasks(self.under(controller), seeds), seeds)

    def towards_obstacle(
        self, controller: str, seeds: Sequence[int], obstacle_at: Callable[[Arm, np.ndarray], Obstacle]
    ) -> WipingEpisodes:
        """Return boards with a lure on the right, begun on the left, and an obstacle between.

        Raises:
            InvalidInputError: the board is too small for it.
        """
        needed = tuple(2 * abs(at) + size for at, size in zip(LURE_AT, LURE_SIZE, strict=True))
        if (np.array(self.config.board.size) < np.array(needed)).any():
            raise InvalidInputError(
                f"a board of {self.config.board.size} m has no room for an object {LURE_AT} m from its centre; "
                f"give {needed} m or more"
            )
        probe, rngs = WipingTasks(self.config, arm=self.arm), [held_out(seed) for seed in seeds]
        worlds = [self.with_obstacle(obstacle_at(probe.arm, meeting_posture(probe, rng))) for rng in rngs]
        tasks = self.make_tasks(self.under(controller), seeds, worlds)
        return WipingEpisodes(tasks, seeds, _lured, rngs)

    def scripted(
        self,
        controller: str,
        seeds: Sequence[int],
        worlds: Sequence[WorldConfig],
        stiffness: Sequence[float],
        works: bool,
    ) -> tuple[WipingEpisodes, Callable[[dict[str, np.ndarray]], np.ndarray]]:
        """Return boards and a script: strokes, or nothing just above the board."""
        action = replace(self.steady_action(stiffness), press=_PRESS)
        config = replace(self.under(controller), action=action)
        tasks = self.make_tasks(config, seeds, [self.with_errors_of(world) for world in worlds])
        x, y, z = tasks.config.board.centre
        start = np.array([x, y, z + (_ABOVE if works else _HOLD_HEIGHT)])
        episodes = WipingEpisodes(tasks, seeds, functools.partial(WipingTasks.reset, start=start))
        return episodes, strokes(action) if works else hold_still

    def outcome(self, trace: np.ndarray, curves: Mapping[str, np.ndarray], succeeded: bool) -> dict[str, float]:
        """Return how much ink went, whether the board is clean, and how long that took."""
        return {
            "ink_removed": float(1.0 - curves["ink_left"][-1]),
            "clean": float(succeeded),
            "time_s": float(trace["time"][-1]) if succeeded else float("nan"),
        }


def meeting_posture(tasks: WipingTasks, rng: np.random.Generator) -> np.ndarray:
    """Sample joint positions at which the forearm meets the obstacle on the tool's path to the lure, (n,), rad."""
    x, y, z = tasks.config.board.centre
    return tasks.posture_over(Pose(np.array([x, y + rng.uniform(*OBSTACLE_AT), z]), DOWN))


def _lured(tasks: WipingTasks, i: int, rng: np.random.Generator) -> None:
    x, y, z = tasks.config.board.centre
    # On the left half of the board: never beyond the obstacle to begin with.
    tasks.reset(i, rng, start=(x + rng.uniform(-0.1, 0.1), y + rng.uniform(0.0, 0.1), z + 0.05))
    tasks.boards.boards[i].place_object((x + LURE_AT[0], y + LURE_AT[1]), LURE_SIZE)
    tasks.observe(i)


def strokes(action: ActionConfig) -> Callable[[dict[str, np.ndarray]], np.ndarray]:
    """Return a script that presses the pad on the board and strokes sideways from where the tool stands.

    Args:
        action: what an action of 1 stands for.
    """
    step = 0

    def act(observation: dict[str, np.ndarray]) -> np.ndarray:
        nonlocal step
        actions = hold_still(observation)
        phase = 2 * math.pi / (POLICY_RATE_HZ * _PERIOD_S)
        actions[:, 1] = _STROKE * (math.sin(phase * (step + 1)) - math.sin(phase * step)) / action.translation[1]
        down = (_ABOVE + _PRESS) / 6  # over the first six steps
        actions[:, 2] = -down / action.translation[2] if step < 6 else 0.0
        step += 1
        return actions

    return act
