"""What a learned policy is compared with: a spiral search, straight down, and random actions. No torch.

Each takes the task's observations and gives its actions as a policy does, 60 times a second.
"""

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.policy.action_config import ACTION_SIZE
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.tasks.base.scripted import RANDOM, Scripted
from contactsafe.tasks.insertion.config import InsertionConfig

PRESS_N = 4.0
"""Force with which the spiral presses, N."""

_PITCH_M = 0.001  # between turns of the spiral: a tip within half of it falls in
_SPEED_M_S = 0.045  # along the spiral
_BEHIND_M = 0.0015  # the spiral waits for a tool that friction keeps further behind
_CATCH_UP = 0.3  # of the distance to the next point, that x_d moves each step: friction keeps the tool behind
_DESCENT_M_S = 0.012
_TOUCH_N = 2.0
_INSIDE_M = 0.0008  # below the believed mouth: the tip is in


class StraightDown(Independent):
    """Go down where the hole is believed to be.

    Args:
        config: of the task.
        num_envs: tasks side by side.
    """

    def __init__(self, config: InsertionConfig, num_envs: int):
        self._step = np.array(config.action.translation)

    def begin(self, i: int) -> None:
        """Begin task i's next episode."""

    def act(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        """Choose the actions, (N, 18)."""
        actions = np.zeros((len(observation["offset"]), ACTION_SIZE), np.float32)
        actions[:, 2] = -_DESCENT_M_S / POLICY_RATE_HZ / self._step[2]
        return actions


class SpiralSearch(Independent):
    """Go down to the block, press lightly and widen a spiral about the believed mouth until the tip falls in.

    Args:
        config: of the task.
        num_envs: tasks side by side.
    """

    def __init__(self, config: InsertionConfig, num_envs: int):
        self._step = np.array(config.action.translation)
        self._angle, self._landed = np.zeros(num_envs), np.zeros(num_envs, bool)

    def begin(self, i: int) -> None:
        """Begin task i's next episode."""
        self._angle[i], self._landed[i] = 0.0, False

    def act(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        """Choose the actions, (N, 18)."""
        offset, target = observation["offset"][:, :3], observation["target"][:, :3]
        force = observation["wrench"][:, 2]
        actions = np.zeros((len(offset), ACTION_SIZE), np.float32)
        for i in range(len(offset)):
            self._landed[i] |= force[i] > _TOUCH_N
            inside = offset[i, 2] < -_INSIDE_M
            tool = offset[i, :2]
            step = -target[i, :2] if inside else _CATCH_UP * (self._spiral(i, tool) - tool)
            actions[i, :2] = step / self._step[:2]
            actions[i, 6:8] = 1.0  # as stiff sideways as actions go
            actions[i, 2] = self._down(i, inside, force[i]) / self._step[2]
        return np.clip(actions, -1.0, 1.0)

    def _spiral(self, i: int, tool: np.ndarray) -> np.ndarray:
        """Return the next point of an Archimedean spiral about the believed mouth, (2,), m."""
        radius = _PITCH_M * self._angle[i] / (2.0 * np.pi)
        point = radius * np.array([np.cos(self._angle[i]), np.sin(self._angle[i])])
        if self._landed[i] and np.linalg.norm(point - tool) < _BEHIND_M:
            self._angle[i] += _SPEED_M_S / POLICY_RATE_HZ / max(radius, _PITCH_M)
        return point

    def _down(self, i: int, inside: bool, force: float) -> float:
        """Return the step of x_d downwards, m: at a steady speed in the air and in the hole, after the force on top."""
        if inside or not self._landed[i]:
            return -_DESCENT_M_S / POLICY_RATE_HZ
        return 2e-4 * float(np.clip((force - PRESS_N) / PRESS_N, -1.0, 1.0))


SCRIPTED: Scripted = {
    "spiral": lambda config, env, seed: SpiralSearch(config, env.num_envs),
    "straight-down": lambda config, env, seed: StraightDown(config, env.num_envs),
    **RANDOM,
}
"""Scripted policies by name, made for a vector environment of the task."""
