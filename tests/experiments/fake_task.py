"""A task that no room knows: the target slides to the right whatever the policy says, and success is to be there."""

from types import MappingProxyType

import numpy as np

from contactsafe.control import presets
from contactsafe.results.figures import Panel
from contactsafe.results.metrics import Aim, Highlight, Metric
from contactsafe.results.recording import Stage, level_rectangle
from contactsafe.robot import robots
from contactsafe.robot.panda import PANDA, WIPER
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.worlds import MAX_TICKS, Worlds
from contactsafe.tasks.wiping.board import Camera
from contactsafe.tasks.wiping.camera import plane_homography

SPEED_M_S, GOAL_M = 0.3, 0.05
START = np.array([0.0, 0.3, 0.0, -2.2, 0.0, 2.5, 0.785])
MEETS = np.array([-0.3, 0.5, -0.05, -2.25, 0.07, 2.75, 0.37])


class ReachingEpisodes:
    """Episodes of `Reaching`; whatever is asked of them, the tool goes at `speed_m_s`."""

    step_limit = 20

    def __init__(self, controller, seeds, worlds=None, speed_m_s=SPEED_M_S):
        self.arm, self.seeds, self.speed_m_s = robots.panda(), seeds, speed_m_s
        configs = worlds or [WorldConfig()] * len(seeds)
        self.worlds = Worlds(self.arm, configs, presets.by_name(controller), len(seeds), list(seeds))
        self.actions = []
        self.begin()

    def begin(self):
        for i in range(self.worlds.n):
            self.worlds.reset(i, START)
        self.start = self.worlds.controllers["target"]["position"][:, 1].copy()

    @property
    def away(self):
        return self.start - self.worlds.controllers["dynamics"]["position"][:, 1]

    @property
    def terminated(self):
        return self.succeeded

    @property
    def succeeded(self):
        return self.away > GOAL_M

    @property
    def camera_homography(self):
        return plane_homography(Camera(), 0.01)

    def observation(self):
        n = self.worlds.n
        sizes = {"pose": 6, "target": 18, "force": 3}
        empty = {name: np.zeros((n, size), np.float32) for name, size in sizes.items()}
        return empty | {"mask": np.full((n, 128, 128, 1), 255, np.uint8)}

    def step(self, actions, traces=None):
        self.actions.append(actions)
        self.worlds.controllers["target"]["position"][:, 1] -= self.speed_m_s * MAX_TICKS / 1000
        self.worlds.run(MAX_TICKS, traces)

    def curves(self):
        return {"away": self.away}

    def pictures(self):
        cells = np.zeros((self.worlds.n, 4, 6), np.uint8)
        for picture, seed in zip(cells, self.seeds, strict=True):
            picture.flat[: seed + 1] = 1  # the more, the larger its seed
        return cells

    def worth_showing(self):
        return np.array(self.seeds)

    def timed(self):
        return {"nothing": (lambda: None, 10)}


class Reaching:
    """The task; see `contactsafe.experiments.task.ExperimentTask`."""

    name = "reaching"
    policy = "A policy reaches."
    metrics = (Metric("away_mm", "distance reached", "mm", main=True, aim=Aim(at_least=1000 * GOAL_M)),)
    aims = MappingProxyType({"tool_force_peak_n": Aim(at_most=3.0), "landing_peak_n": Aim(at_most=2.0)})
    highlights = (Highlight("reaching", "away_mm", "Distance reached"),)
    panels = (Panel("distance", "m", lambda run: run.curves["away"]),)
    arm = robots.panda()
    stage = Stage(PANDA, WIPER, level_rectangle((0.5, 0.0, 0.01), (0.5, 0.6)), {1: (200, 0, 0)})

    def episodes(self, controller, seeds):
        return ReachingEpisodes(controller, seeds)

    def towards_obstacle(self, controller, seeds, obstacle_at):
        worlds = [WorldConfig(obstacles=(obstacle_at(robots.panda(), MEETS),)) for _ in seeds]
        return ReachingEpisodes(controller, seeds, worlds)

    def scripted(self, controller, seeds, worlds, stiffness, works):
        episodes = ReachingEpisodes(controller, seeds, worlds, 0.05 if works else 0.0)
        episodes.worlds.controllers["target"]["K_task"] = stiffness
        return episodes, lambda observation: np.zeros((len(seeds), 18))

    def outcome(self, trace, curves, succeeded):
        return {"away_mm": float(1000.0 * curves["away"][-1]), "success": float(succeeded)}
