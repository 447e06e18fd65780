"""Scripted policies to compare a learned one with: a raster, a servo to the nearest ink, random actions. No torch.

Each takes the task's observations and returns its actions as a policy does, 60 times a second.
"""

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.policy.action_config import ACTION_SIZE
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.tasks.base.scripted import RANDOM, Scripted
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.vision.log_polar import RINGS, SECTORS, ground_of, log_polar_features

PRESS_N = 5.0
"""Force that the scripts press with, N."""

TOUCH_N = 1.5
"""Force from which they take the pad to be on the board, N: above what sensor bias and noise come to."""

DESCENT_M_S = 0.05
SPEED_M_S = 0.25
LANE_M = 0.045
"""Distance between lanes of the raster, m: three quarters of the pad."""

ARRIVED_M = 0.02
"""How near the tool comes to a corner before the next is its goal, m: friction keeps it from being nearer."""


class _Script(Independent):
    """Land slowly, press gently, and go where `_goal` says: what the scripts have in common.

    Args:
        config: of the task.
        num_envs: tasks side by side.
    """

    def __init__(self, config: WipingConfig, num_envs: int):
        self.config = config
        self._landed = np.zeros(num_envs, bool)
        self._step = np.array(config.action.translation)

    def begin(self, i: int) -> None:
        """Forget what was done in task i: its next episode begins."""
        self._landed[i] = False

    def act(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        """Choose the actions, (N, 18), for N observations."""
        pose, target = observation["pose"][:, :3], observation["target"][:, :3]
        force = observation["force"][:, 2]
        actions = np.zeros((len(pose), ACTION_SIZE), np.float32)
        for i in range(len(pose)):
            goal, lower = self._goal(i, observation)
            step = goal - (pose[i, :2] + target[i, :2])
            most = SPEED_M_S / POLICY_RATE_HZ
            actions[i, :2] = step * most / max(float(np.linalg.norm(step)), most) / self._step[:2]
            if lower:
                actions[i, 2] = self._press(i, force[i]) / self._step[2]
        return np.clip(actions, -1.0, 1.0)

    def _press(self, i, force):
        """Return the step of x_d downwards, m: at a steady speed to the board, then after the force."""
        self._landed[i] |= force > TOUCH_N
        if not self._landed[i]:
            return -DESCENT_M_S / POLICY_RATE_HZ
        return 2e-4 * np.clip((force - PRESS_N) / PRESS_N, -1.0, 1.0)

    def _goal(self, i, observation):
        raise NotImplementedError


class Raster(_Script):
    """Wipe the whole area that may be painted on, lane by lane, without looking."""

    def __init__(self, config: WipingConfig, num_envs: int):
        super().__init__(config, num_envs)
        board = config.board
        half = board.ink_size / 2
        lanes = np.linspace(-half + 0.02, half - 0.02, 1 + int(np.ceil((2 * half - 0.04) / LANE_M)))
        ends = [(x, side * half) for k, x in enumerate(lanes) for side in ((-1, 1) if k % 2 == 0 else (1, -1))]
        self._corners = np.array(ends) + board.centre[:2]
        self._next = np.zeros(num_envs, int)

    def begin(self, i: int) -> None:
        """Start again at the first corner."""
        super().begin(i)
        self._next[i] = 0

    def _goal(self, i, observation):
        corner = self._corners[self._next[i]]
        arrived = np.linalg.norm(corner - observation["pose"][i, :2]) < ARRIVED_M
        down = self._next[i] > 0 or arrived
        if arrived and self._landed[i]:
            self._next[i] = (self._next[i] + 1) % len(self._corners)
        return corner, down


class NearestInk(_Script):
    """Go straight to the nearest ink in view, as a visual servo would."""

    def __init__(self, config: WipingConfig, num_envs: int, homography: np.ndarray):
        super().__init__(config, num_envs)
        size = config.camera.size
        self._ground = ground_of(homography, (size, size))

    def act(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        """Choose the actions, (N, 18), for N observations."""
        picture = log_polar_features(observation["mask"], observation["pose"], self._ground)
        soft = picture[:, RINGS * SECTORS : RINGS * SECTORS + 3]
        length = np.linalg.norm(soft[:, :2], axis=1, keepdims=True)
        self._away = 0.1 * soft[:, 2:] * soft[:, :2] / np.maximum(length, 1e-9)
        return super().act(observation)

    def _goal(self, i, observation):
        # Beyond the ink by the distance that friction keeps the tool behind.
        away = self._away[i]
        beyond = ARRIVED_M / max(float(np.linalg.norm(away)), ARRIVED_M)
        return observation["pose"][i, :2] + away * (1.0 + beyond), True


SCRIPTED: Scripted = {
    "raster": lambda config, env, seed: Raster(config, env.num_envs),
    "nearest-ink": lambda config, env, seed: NearestInk(config, env.num_envs, env.unwrapped.camera_homography),
    **RANDOM,
}
"""Scripted policies by name, made for a vector environment of the task."""
