"""The wiping task for Gymnasium: one environment, or many stepped in native threads."""

import copy
from collections.abc import Iterable, Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.state import Entry, load_state_dict, of_generators, of_object, state_dict
from contactsafe.policy.action_config import ACTION_SIZE
from contactsafe.policy.observation import Observation
from contactsafe.sim.world import POLICY_RATE_HZ
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.figures import EPISODE_METRICS, FIGURES
from contactsafe.tasks.wiping.observation import observation_vectors
from contactsafe.tasks.wiping.tasks import WipingTasks

_RENDER_MODES = ["rgb_array"]


def _spaces(config: WipingConfig) -> tuple[gymnasium.spaces.Dict, gymnasium.spaces.Box]:
    size = config.world.camera.size
    observation = gymnasium.spaces.Dict(
        {
            **{
                vector.name: gymnasium.spaces.Box(-np.inf, np.inf, (vector.size,), np.float32)
                for vector in observation_vectors(config.action)
            },
            "mask": gymnasium.spaces.Box(0, 255, (size, size, 1), np.uint8),
        }
    )
    return observation, gymnasium.spaces.Box(-1.0, 1.0, (ACTION_SIZE,), np.float32)


class _Wiping(Independent):
    """What the single and the vector environment have in common: tasks, their limits, and Gymnasium's order of calls.

    Copies, pickled or not, have worlds of their own and go on from where the original is.
    """

    metadata: dict[str, Any] = {"render_modes": _RENDER_MODES, "render_fps": POLICY_RATE_HZ}
    task_type: type[WipingTasks] = WipingTasks
    episode_metrics = EPISODE_METRICS
    figures = FIGURES
    _spec: EnvSpec | None = None
    _was_reset = _is_closed = False

    def _begin(
        self, config: WipingConfig | None, num_envs: int, render_mode: str | None, max_episode_steps: int | None
    ) -> None:
        if render_mode is not None and render_mode not in _RENDER_MODES:
            raise InvalidInputError(f"render_mode = {render_mode!r}; choose {' or '.join(_RENDER_MODES)}, or None")
        if max_episode_steps is not None and max_episode_steps < 1:
            raise InvalidInputError(
                f"max_episode_steps = {max_episode_steps}; give 1 or more, or None for the config's"
            )
        self.render_mode = render_mode
        self.tasks = self.task_type(config, num_envs)
        if max_episode_steps is not None:
            self.tasks.step_limit = int(max_episode_steps)

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium made it from; its `max_episode_steps` is that of the task."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = copy.copy(spec)
        if self._spec is not None and self._spec.max_episode_steps is None:
            self._spec.max_episode_steps = self.tasks.step_limit

    @property
    def observation_vectors(self) -> tuple[Observation, ...]:
        """What policies may observe besides the mask."""
        return observation_vectors(self.tasks.config.action)

    @property
    def camera_homography(self) -> np.ndarray:
        """Board-plane coordinates (x, y, 1), m, to mask pixels (u, v, w), (3, 3)."""
        return self.tasks.worlds.homography

    def _check_order(self, doing: str) -> None:
        if self._is_closed:
            raise ClosedEnvironmentError(f"`{doing}` was called after `close`; make the environment anew")
        if doing != "reset" and not self._was_reset:
            raise ResetNeeded(f"`{doing}` was called before `reset`; call `reset` first")

    def _picture(self, i: int) -> np.ndarray:
        """Give mask i as an image, uint8 (512, 512, 3)."""
        return np.kron(self.tasks.worlds.masks[i], np.ones((4, 4), np.uint8))[..., None].repeat(3, axis=-1)


def _drawing_of(options: dict[str, Any] | None, *others: str) -> Any:
    """Give the drawing among the options of a reset, None where there is none; refuse what is not known."""
    options = options or {}
    unknown = [str(name) for name in options if name not in ("drawing", *others)]
    if unknown:
        raise InvalidInputError(
            f"reset options hold {', '.join(unknown)}; known are {', '.join(('drawing', *others))}; leave others out"
        )
    return options.get("drawing")


def _seed_of(seed: Any) -> int | None:
    """Give a seed as Gymnasium's generators want it, NumPy's whole numbers too.

    Raises:
        InvalidInputError: it is no whole number, or negative.
    """
    if seed is None:
        return None
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InvalidInputError(f"seed = {seed!r}; give a whole number, 0 or more, or None")
    return int(seed)


class WipingEnv(_Wiping, gymnasium.Env):
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
        max_episode_steps: in place of `config.episode_s`; `gymnasium.make` takes this for the shorter of the two.
    """

    def __init__(
        self,
        config: WipingConfig | None = None,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
    ):
        self._begin(config, 1, render_mode, max_episode_steps)
        self.observation_space, self.action_space = _spaces(self.tasks.config)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Begin an episode with a new board; see `gymnasium.Env.reset`."""
        self._check_order("reset")
        drawing, seed = _drawing_of(options), _seed_of(seed)
        super().reset(seed=seed)
        if seed is not None:
            self.tasks.worlds.seed(seed)
        self.tasks.reset(0, self.np_random, drawing=drawing)
        self._was_reset = True
        return self.tasks.observation(0), {"ink_left": 1.0}

    def step(self, action):
        """Run 1/60 s; see `gymnasium.Env.step`."""
        self._check_order("step")
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
        self._check_order("render")
        return self._picture(0)

    def close(self) -> None:
        """End the simulation; see `gymnasium.Env.close`."""
        self.tasks.worlds.close()
        self._is_closed = True


class WipingVectorEnv(_Wiping, gymnasium.vector.VectorEnv):
    """N wiping tasks stepped in native threads: `gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=N)`.

    Same spaces and infos as `WipingEnv`, batched; an episode that ends is reset in the same step, its last
    observation and info under `final_obs` and `final_info`. `reset(options={"reset_mask": mask})` begins new episodes
    where the mask, bool (N,), is true, and leaves the others as they are.

    Args:
        num_envs: N.
        config: of the task.
        render_mode: 'rgb_array' gives the masks enlarged, or None.
        max_episode_steps: in place of `config.episode_s`.
    """

    autoreset_mode = AutoresetMode.SAME_STEP
    metadata = {**_Wiping.metadata, "autoreset_mode": autoreset_mode}

    def __init__(
        self,
        num_envs: int = 1,
        config: WipingConfig | None = None,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
    ):
        if not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise InvalidInputError(f"num_envs = {num_envs!r}; give a whole number from 1 on")
        self.num_envs = int(num_envs)
        self._begin(config, self.num_envs, render_mode, max_episode_steps)
        self.single_observation_space, self.single_action_space = _spaces(self.tasks.config)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._rngs: list[np.random.Generator] = []

    def reset(self, *, seed=None, options: dict[str, Any] | None = None):
        """Begin an episode in every task, or in those of `options["reset_mask"]`.

        Args:
            seed: a number seeds environment i with seed + i; a sequence gives one each, None for a random one; None
                goes on with the generators in use.
            options: `drawing` for all boards; `reset_mask`, bool (N,).

        Returns:
            Observations of all tasks, and infos.
        """
        self._check_order("reset")
        drawing = _drawing_of(options, "reset_mask")
        chosen = self._chosen(options or {})
        if seed is not None or not self._rngs:
            self._seed(seed, chosen)
        for i in chosen:
            self.tasks.reset(i, self._rngs[i], drawing=drawing)
        self._was_reset = True
        begun = np.zeros(self.num_envs, bool)
        begun[chosen] = True
        ink_left = np.where(begun, 1.0, self.tasks.info()["ink_left"])
        return self.tasks.observation(), {"ink_left": ink_left, "_ink_left": begun}

    def _chosen(self, options: Mapping[str, Any]) -> list[int]:
        """Give the numbers of the tasks to reset."""
        if options.get("reset_mask") is None:
            return list(range(self.num_envs))
        mask = np.asarray(options["reset_mask"])
        if mask.dtype != bool or mask.shape != (self.num_envs,) or not mask.any():
            raise InvalidInputError(
                f"reset_mask is {mask.dtype} of shape {mask.shape}, {int(np.count_nonzero(mask))} of it true; give "
                f"bool ({self.num_envs},), one or more of it true"
            )
        if not self._was_reset and not mask.all():
            raise ResetNeeded("`reset` with a reset_mask was called before all had been reset; call `reset` first")
        return np.flatnonzero(mask).tolist()

    def _seed(self, seed: Any, chosen: list[int]) -> None:
        """Seed the generators of the chosen tasks, and the sensors' noise where those are all."""
        if seed is None or isinstance(seed, int | np.integer):
            first = _seed_of(seed)
            seeds = [None if first is None else first + i for i in range(self.num_envs)]
        else:
            seeds = [_seed_of(one) for one in (seed if isinstance(seed, Iterable) else [seed])]
        if len(seeds) != self.num_envs:
            raise InvalidInputError(f"{len(seeds)} seeds for {self.num_envs} environments; give one each")
        rngs = [seeding.np_random(one)[0] for one in seeds]
        if len(chosen) == self.num_envs:
            self._rngs[:] = rngs
            self.tasks.worlds.seed(seeds[0])
        for i in chosen:
            self._rngs[i] = rngs[i]
        self._np_random, self._np_random_seed = seeding.np_random(seeds[0])

    def step(self, actions):
        """Run 1/60 s in every task; see `gymnasium.vector.VectorEnv.step`."""
        self._check_order("step")
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

    def state_entries(self) -> dict[str, Entry]:
        """List what decides the environment's future."""
        return {"tasks": of_object(self.tasks), "episodes": of_generators(self._rngs)}

    def state_dict(self) -> dict[str, Any]:
        """Return all that decides the environment's future, as plain values and arrays."""
        return state_dict(self.state_entries())

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Load the state of an environment made alike: this one goes on as that did, to the bit.

        Raises:
            InvalidInputError: it is of another environment, or of another version.
        """
        load_state_dict(self.state_entries(), state)
        self._was_reset = bool(self._rngs)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Give the masks as images, uint8 (512, 512, 3) each."""
        if self.render_mode is None:
            return None
        self._check_order("render")
        return tuple(self._picture(i) for i in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the native threads."""
        self.tasks.worlds.close()
        self._is_closed = True
