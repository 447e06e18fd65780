"""The wiping task for Gymnasium: one environment, or many stepped in native threads."""

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from contactsafe.envs.config import WipingConfig
from contactsafe.envs.tasks import ACTION_SIZE, OBSERVED, WipingTasks
from contactsafe.errors import InvalidInputError
from contactsafe.sim.snapshot import Part, of_generators, of_object, put, take
from contactsafe.sim.world import POLICY_RATE_HZ


def _spaces(config: WipingConfig) -> tuple[gymnasium.spaces.Dict, gymnasium.spaces.Box]:
    size = config.world.camera.size
    observation = gymnasium.spaces.Dict(
        {
            **{name: gymnasium.spaces.Box(-np.inf, np.inf, (k,), np.float32) for name, k in OBSERVED.items()},
            "mask": gymnasium.spaces.Box(0, 255, (size, size, 1), np.uint8),
        }
    )
    return observation, gymnasium.spaces.Box(-1.0, 1.0, (ACTION_SIZE,), np.float32)


class WipingEnv(gymnasium.Env):
    """Wipe the ink off a whiteboard: `contactsafe/Wiping-v0`.

    Observation: `pose`, tool position (m, world) and rotation vector from straight down (rad), (6,); `target`, x_d less
    that pose (m, rad), K1 (1/s²) and D1 (1/s) as now in force, (18,); `force` of the board on the tool as the wrist
    measures it, smoothed, world axes (N), (3,); `mask`, the segmented camera image, ink 0 and everything else 255,
    (128, 128, 1).
    Action: increments of x_d (6), K1 (6) and D1 (6), in [−1, 1], 60 Hz over 1 kHz ticks.
    `reset(options={"drawing": image})` puts a drawing of the user's own on the board.

    Args:
        config: of the task.
        render_mode: 'rgb_array' gives the mask enlarged, or None.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": POLICY_RATE_HZ}
    task_type: type[WipingTasks] = WipingTasks

    def __init__(self, config: WipingConfig | None = None, render_mode: str | None = None):
        self.tasks = self.task_type(config)
        self.render_mode = render_mode
        self.observation_space, self.action_space = _spaces(self.tasks.config)

    @property
    def camera_homography(self) -> np.ndarray:
        """Board-plane coordinates (x, y, 1), m, to mask pixels (u, v, w), (3, 3)."""
        return self.tasks.worlds.homography

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Begin an episode with a new board; see `gymnasium.Env.reset`."""
        super().reset(seed=seed)
        if seed is not None:
            self.tasks.worlds.seed(seed)
        self.tasks.reset(0, self.np_random, drawing=(options or {}).get("drawing"))
        return self.tasks.observation(0), {"ink_left": 1.0}

    def step(self, action):
        """Run 1/60 s; see `gymnasium.Env.step`."""
        self.tasks.step(np.asarray(action)[None])
        info = {name: value[0] for name, value in self.tasks.info().items()}
        tasks = self.tasks
        return (
            tasks.observation(0), float(tasks.reward[0]), bool(tasks.terminated[0]), bool(tasks.truncated[0]), info,
        )  # fmt: skip

    def render(self):
        """Give the mask as an image, uint8 (512, 512, 3)."""
        if self.render_mode is None:
            return None
        return np.kron(self.tasks.worlds.masks[0], np.ones((4, 4), np.uint8))[..., None].repeat(3, axis=-1)

    def close(self) -> None:
        """End the simulation; see `gymnasium.Env.close`."""
        self.tasks.worlds.close()


class WipingVectorEnv(gymnasium.vector.VectorEnv):
    """N wiping tasks stepped in native threads: `gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=N)`.

    Same spaces and infos as `WipingEnv`, batched; an episode that ends is reset in the same step, its last
    observation and info under `final_obs` and `final_info`.

    Args:
        num_envs: N.
        config: of the task.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP, "render_fps": POLICY_RATE_HZ}
    task_type: type[WipingTasks] = WipingTasks

    def __init__(self, num_envs: int = 1, config: WipingConfig | None = None):
        if num_envs < 1:
            raise InvalidInputError(f"num_envs = {num_envs}; give 1 or more")
        self.num_envs = num_envs
        self.tasks = self.task_type(config, num_envs)
        self.single_observation_space, self.single_action_space = _spaces(self.tasks.config)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._rngs: list[np.random.Generator] = []

    @property
    def camera_homography(self) -> np.ndarray:
        """Board-plane coordinates (x, y, 1), m, to mask pixels (u, v, w), (3, 3)."""
        return self.tasks.worlds.homography

    def reset(self, *, seed: int | list[int] | None = None, options: dict[str, Any] | None = None):
        """Begin an episode in every task; a number seeds environment i with seed + i."""
        if seed is not None or not self._rngs:
            seeds = (
                seed if isinstance(seed, list) else [None if seed is None else seed + i for i in range(self.num_envs)]
            )
            if len(seeds) != self.num_envs:
                raise InvalidInputError(f"{len(seeds)} seeds for {self.num_envs} environments; give one each")
            self._rngs = [np.random.default_rng(s) for s in seeds]
            self.tasks.worlds.seed(seeds[0])
        drawing = (options or {}).get("drawing")
        for i in range(self.num_envs):
            self.tasks.reset(i, self._rngs[i], drawing=drawing)
        ones = np.ones(self.num_envs)
        return self.tasks.observation(), {"ink_left": ones, "_ink_left": ones.astype(bool)}

    def step(self, actions):
        """Run 1/60 s in every task; see `gymnasium.vector.VectorEnv.step`."""
        tasks = self.tasks
        tasks.step(actions)
        reward, terminated, truncated = tasks.reward, tasks.terminated, tasks.truncated
        info: dict[str, Any] = tasks.info()
        ended = terminated | truncated
        if ended.any():
            info = self._restart(ended, info)
        info |= {f"_{name}": np.ones(self.num_envs, bool) for name in list(info) if not name.startswith(("_", "final"))}
        return tasks.observation(), reward, terminated, truncated, info

    def _restart(self, ended: np.ndarray, info: dict[str, Any]) -> dict[str, Any]:
        """Reset ended tasks, keeping their last observation and info."""
        final_obs = np.full(self.num_envs, None, dtype=object)
        final_info = {name: value.copy() for name, value in info.items()}
        final_info |= {f"_{name}": ended.copy() for name in info}
        for i in np.flatnonzero(ended):
            final_obs[i] = self.tasks.observation(i)
            self.tasks.reset(int(i), self._rngs[i])
        info["ink_left"] = np.where(ended, 1.0, info["ink_left"])
        return info | {
            "final_obs": final_obs, "_final_obs": ended.copy(), "final_info": final_info, "_final_info": ended.copy(),
        }  # fmt: skip

    def parts(self) -> dict[str, Part]:
        """List what decides the environment's future."""
        return {"tasks": of_object(self.tasks), "episodes": of_generators(self._rngs)}

    def snapshot(self) -> dict[str, Any]:
        """Take all that decides the environment's future, as plain values and arrays."""
        return take(self.parts())

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Put the environment where a snapshot of one made alike was taken: it goes on as that did, to the bit.

        Raises:
            InvalidInputError: it is of another environment, or of another version.
        """
        put(self.parts(), snapshot)

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the native threads."""
        self.tasks.worlds.close()
