"""A board without physics: same spaces, camera geometry and infos as the wiping task, in microseconds a step."""

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from contactsafe.core.state import Entry, load_state_dict, of_array, of_generators, state_dict
from contactsafe.policy.action_config import ActionConfig
from contactsafe.tasks.wiping.figures import EPISODE_METRICS, FIGURES
from contactsafe.tasks.wiping.observation import observation_vectors

BOARD = np.array([0.5, 0.0])
INK_SIDE_M = 0.30
MASK = 128
PAD_M = 0.05
ACTION_SIZE = 18


def camera_homography():
    """Board plane to pixels of a camera that looks at the board from the far side, 45° down, (3, 3)."""
    eye, target = np.array([1.15, 0.0, 0.65]), np.array([0.5, 0.0, 0.0])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    R = np.stack([right, down, forward])
    t = -R @ eye
    K = np.array([[200.0, 0.0, 64.0], [0.0, 200.0, 64.0], [0.0, 0.0, 1.0]])
    return K @ np.column_stack([R[:, 0], R[:, 1], t])


def pixel_grid(homography):
    """Where each pixel centre lies on the board, (128, 128, 2), m."""
    u, v = np.meshgrid(np.arange(MASK) + 0.5, np.arange(MASK) + 0.5)
    points = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(homography).T
    return points[..., :2] / points[..., 2:]


class Board:
    """Ink as discs on the board: drawn, wiped and photographed."""

    def __init__(self, rng, strokes=None):
        self.points = []
        for _ in range(int(rng.integers(1, 5)) if strokes is None else strokes):
            start = rng.uniform(-0.13, 0.13, 2)
            steps = np.cumsum(rng.normal(0.0, 0.006, (30, 2)) + rng.normal(0.0, 0.005, 2), axis=0)
            self.points.append(np.clip(start + steps, -0.145, 0.145))
        self.points = BOARD + np.concatenate(self.points)
        self.total = len(self.points)

    def wipe(self, xy):
        """Erase what lies under a square pad at xy; return the fraction of all ink erased."""
        kept = self.points[np.abs(self.points - xy).max(axis=1) > PAD_M / 2]
        fraction = (len(self.points) - len(kept)) / self.total
        self.points = kept
        return fraction

    @property
    def left(self):
        """Fraction of the ink still there, 0..1."""
        return len(self.points) / self.total

    def mask(self, homography):
        """What the camera sees, (128, 128) uint8."""
        mask = np.full((MASK, MASK), 255, np.uint8)
        if len(self.points):
            pixels = np.column_stack([self.points, np.ones(len(self.points))]) @ homography.T
            u, v = np.floor(pixels[:, :2] / pixels[:, 2:]).astype(int).T
            for du, dv in ((0, 0), (1, 0), (0, 1), (1, 1)):
                inside = (u + du >= 0) & (u + du < MASK) & (v + dv >= 0) & (v + dv < MASK)
                mask[(v + dv)[inside], (u + du)[inside]] = 0
        return mask


def sample_masks(n, seed):
    """Boards from full to nearly clean and where the tool was, ((n, 128, 128) uint8, (n, 3) m)."""
    rng = np.random.default_rng(seed)
    homography = camera_homography()
    masks = np.empty((n, MASK, MASK), np.uint8)
    tools = np.column_stack([BOARD + rng.uniform(-0.16, 0.16, (n, 2)), rng.uniform(0.0, 0.1, n)])
    for i in range(n):
        board = Board(rng)
        board.points = board.points[rng.random(len(board.points)) < rng.random() ** 2 + 0.01]
        masks[i] = board.mask(homography)
    return masks, tools


class FakeWiping(VectorEnv):
    """A pad that glides over the board at once to where it is told; SAME_STEP autoreset, as the real task has it."""

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
    observation_vectors = observation_vectors(ActionConfig())
    episode_metrics = EPISODE_METRICS
    figures = FIGURES

    def __init__(self, num_envs=4, max_steps=60):
        self.num_envs = num_envs
        self.max_steps = max_steps
        self.camera_homography = camera_homography()
        self.single_observation_space = gymnasium.spaces.Dict(
            pose=gymnasium.spaces.Box(-np.inf, np.inf, (6,), np.float32),
            target=gymnasium.spaces.Box(-np.inf, np.inf, (18,), np.float32),
            force=gymnasium.spaces.Box(-np.inf, np.inf, (3,), np.float32),
            mask=gymnasium.spaces.Box(0, 255, (MASK, MASK, 1), np.uint8),
        )
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (ACTION_SIZE,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.rngs = [np.random.default_rng(i) for i in range(num_envs)]
        self.boards, self.xy, self.steps = [None] * num_envs, np.zeros((num_envs, 2)), np.zeros(num_envs, int)

    def reset(self, *, seed=None, options=None):
        """Start every environment anew."""
        if seed is not None:
            self.rngs = [np.random.default_rng(seed + i) for i in range(self.num_envs)]
        for i in range(self.num_envs):
            self._reset_one(i)
        return self._observe(), self._info(np.zeros(self.num_envs), np.zeros(self.num_envs))

    def state_entries(self):
        return {
            "rngs": of_generators(self.rngs),
            "xy": of_array(self.xy),
            "steps": of_array(self.steps),
            "boards": Entry(lambda: [{**vars(board)} for board in self.boards], self._set_boards),
        }

    def _set_boards(self, values):
        self.boards = [Board(np.random.default_rng(0)) for _ in values]
        for board, value in zip(self.boards, values, strict=True):
            vars(board).update(value)

    def state_dict(self):
        """All that decides the future."""
        return state_dict(self.state_entries())

    def load_state_dict(self, state):
        """Put it back."""
        load_state_dict(self.state_entries(), state)

    def _reset_one(self, i):
        self.boards[i] = Board(self.rngs[i], strokes=1)
        self.xy[i] = BOARD + self.rngs[i].uniform(-0.1, 0.1, 2)
        self.steps[i] = 0

    def _observe(self):
        pose = np.zeros((self.num_envs, 6), np.float32)
        pose[:, :2] = self.xy
        return {
            "pose": pose,
            "target": np.zeros((self.num_envs, 18), np.float32),
            "force": np.zeros((self.num_envs, 3), np.float32),
            "mask": np.stack([b.mask(self.camera_homography) for b in self.boards])[..., None],
        }

    def _info(self, ink, distance):
        left = np.array([b.left for b in self.boards])
        return {
            "reward_ink": ink,
            "reward_approach": distance,
            "ink_left": left,
            "tool_force_n": np.full(self.num_envs, 3.0),
            "is_success": left == 0.0,
        }

    def step(self, actions):
        """Move each pad by up to 2 cm, wipe, reset what ended."""
        actions = np.asarray(actions)
        assert np.all(np.abs(actions) <= 1.0)
        ink, approach = np.zeros(self.num_envs), np.zeros(self.num_envs)
        for i, board in enumerate(self.boards):
            before = np.linalg.norm(board.points - self.xy[i], axis=1).min()
            self.xy[i] = np.clip(self.xy[i] + 0.02 * actions[i, :2], BOARD - 0.16, BOARD + 0.16)
            ink[i] = 10.0 * board.wipe(self.xy[i])
            if board.left and not ink[i]:
                approach[i] = 5.0 * (before - np.linalg.norm(board.points - self.xy[i], axis=1).min())
        self.steps += 1
        info = self._info(ink, approach)
        terminated, truncated = info["is_success"].copy(), self.steps >= self.max_steps
        truncated &= ~terminated
        done = terminated | truncated
        if done.any():
            final = self._observe()
            info["final_info"] = dict(info)
            info["final_obs"] = np.full(self.num_envs, None, object)
            for i in np.flatnonzero(done):
                info["final_obs"][i] = {k: v[i].copy() for k, v in final.items()}
                self._reset_one(i)
            info["_final_obs"] = info["_final_info"] = done
            info.update(
                {
                    k: v
                    for k, v in self._info(np.zeros(self.num_envs), np.zeros(self.num_envs)).items()
                    if k == "ink_left"
                }
            )
        return self._observe(), ink + approach, terminated, truncated, info


class GuidedWiping(FakeWiping):
    """The same, with the direction of the nearest ink where the pose has its rotation: no encoder needed."""

    def _observe(self):
        seen = super()._observe()
        for i, board in enumerate(self.boards):
            nearest = board.points[np.abs(board.points - self.xy[i]).sum(axis=1).argmin()] if board.left else BOARD
            seen["pose"][i, 3:5] = 2.0 * (nearest - self.xy[i])
        return seen
