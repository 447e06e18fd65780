"""One task for Gymnasium."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.robot.arm import Arm
from contactsafe.robot.calibration import Calibration
from contactsafe.tasks.base.config import TaskConfig
from contactsafe.tasks.base.environment import Environment, seed_of
from contactsafe.tasks.base.tasks import Tasks


class TaskEnv(Environment, gymnasium.Env):
    """One task: `gymnasium.make("contactsafe/Wiping-v0")`, and so on for every task.

    Observation: what the task declares. Action: increments of x_d (6), K1 (6) and D1 (6), in [−1, 1], at 60 Hz over
    1 kHz ticks.

    Args:
        task: name of the task, or its class.
        config: of the task.
        engine: 'mujoco' or 'pybullet'.
        arm: that works; None for the task's own, or what was identified of that.
        render_mode: 'rgb_array' renders the task's picture, or None.
        max_episode_steps: in place of `config.episode_s`; `gymnasium.make` takes this for the shorter of the two.
    """

    def __init__(
        self,
        task: str | type[Tasks] = "wiping",
        config: TaskConfig | None = None,
        engine: str = "mujoco",
        arm: Arm | Calibration | None = None,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
    ):
        made = self._make(task, 1, config, engine, arm, render_mode, max_episode_steps)
        self.observation_space, self.action_space = made

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Begin an episode; see `gymnasium.Env.reset`."""
        self._check_order("reset")
        chosen, seed = self._options(options), seed_of(seed)
        super().reset(seed=seed)
        if seed is not None:
            self.tasks.worlds.seed(seed)
        self.tasks.reset(0, self.np_random, **chosen)
        self._was_reset = True
        return self.tasks.observation(0), dict(self.tasks.start_info)

    def step(self, action: ArrayLike) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Run 1/60 s; see `gymnasium.Env.step`."""
        self._check_order("step")
        tasks = self.tasks
        tasks.step(np.asarray(action)[None])
        info = {name: value[0] for name, value in tasks.info().items()}
        ends = bool(tasks.terminated[0]), bool(tasks.truncated[0])
        return tasks.observation(0), float(tasks.reward[0]), *ends, info

    def render(self) -> np.ndarray | None:
        """Return the task's picture, uint8 (height, width, 3)."""
        if self.render_mode is None:
            return None
        self._check_order("render")
        return self.tasks.picture(0)

    def close(self) -> None:
        """End the simulation; see `gymnasium.Env.close`."""
        self.tasks.worlds.close()
        self._is_closed = True
