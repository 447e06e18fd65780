"""Many tasks for Gymnasium, stepped in native threads."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.state import Entry, load_state_dict, of_array, of_generators, of_object, state_dict
from contactsafe.robot.arm import Arm
from contactsafe.robot.calibration import Calibration
from contactsafe.tasks.base.config import TaskConfig
from contactsafe.tasks.base.environment import Environment, seed_of
from contactsafe.tasks.base.tasks import Tasks


class TaskVectorEnv(Environment, gymnasium.vector.VectorEnv):
    """N tasks stepped in native threads: `gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=N)`.

    Same spaces and infos as `TaskEnv`, batched. `reset(options={"reset_mask": mask})` begins new episodes where the
    mask, bool (N,), is true, and leaves the others as they are. What becomes of an episode that ends is Gymnasium's
    autoreset mode: SAME_STEP resets it in the same step, its last observation and info under `final_obs` and
    `final_info`; NEXT_STEP in the next one, whose action it ignores; DISABLED leaves it to the caller. Where a step
    resets, `info` says what a reset says; all else in it is 0 there, and its mask `_name` false.

    Args:
        num_envs: N.
        task, config, engine, arm, render_mode, max_episode_steps: as for `TaskEnv`.
        autoreset_mode: one of Gymnasium's three.
    """

    def __init__(
        self,
        num_envs: int = 1,
        task: str | type[Tasks] = "wiping",
        config: TaskConfig | None = None,
        engine: str = "mujoco",
        arm: Arm | Calibration | None = None,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
    ):
        if not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise InvalidInputError(f"num_envs = {num_envs!r}; give a whole number from 1 on")
        self.num_envs = int(num_envs)
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.metadata = {**Environment.metadata, "autoreset_mode": self.autoreset_mode}
        made = self._make(task, self.num_envs, config, engine, arm, render_mode, max_episode_steps)
        self.single_observation_space, self.single_action_space = made
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._rngs: list[np.random.Generator] = []
        self._ended = np.zeros(self.num_envs, bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Begin an episode in every task, or in those of `options["reset_mask"]`.

        Args:
            seed: a number seeds environment i with seed + i; a sequence holds one each, None for a random one; None
                goes on with the generators in use.
            options: those of the task, for all; `reset_mask`, bool (N,).

        Returns:
            Observations of all tasks, and infos.
        """
        self._check_order("reset")
        of_task = self._options(options, "reset_mask")
        chosen = self._chosen(options or {})
        if seed is not None or not self._rngs:
            self._seed(seed, chosen)
        for i in chosen:
            self.tasks.reset(i, self._rngs[i], **of_task)
        self._was_reset = True
        begun = np.zeros(self.num_envs, bool)
        begun[chosen] = True
        self._ended[begun] = False
        return self.tasks.observation(), self._start_info(begun)

    def _start_info(self, begun: np.ndarray) -> dict[str, np.ndarray]:
        """Return what is said of episodes that begin, where `begun`, bool (N,)."""
        info = {}
        for name, value in self.tasks.start_info.items():
            info[name], info[f"_{name}"] = np.where(begun, value, 0.0), begun.copy()
        return info

    def _chosen(self, options: Mapping[str, Any]) -> list[int]:
        """Return the numbers of the tasks to reset."""
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
            first = seed_of(seed)
            seeds = [None if first is None else first + i for i in range(self.num_envs)]
        else:
            seeds = [seed_of(one) for one in (seed if isinstance(seed, Iterable) else [seed])]
        if len(seeds) != self.num_envs:
            raise InvalidInputError(f"{len(seeds)} seeds for {self.num_envs} environments; give one each")
        rngs = [seeding.np_random(one)[0] for one in seeds]
        if len(chosen) == self.num_envs:
            self._rngs[:] = rngs
            self.tasks.worlds.seed(seeds[0])
        for i in chosen:
            self._rngs[i] = rngs[i]
        self._np_random, self._np_random_seed = seeding.np_random(seeds[0])

    def step(
        self, actions: ArrayLike
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Run 1/60 s in every task; see `gymnasium.vector.VectorEnv.step`."""
        self._check_order("step")
        tasks, before = self.tasks, self._ended.copy()
        if before.any() and self.autoreset_mode == AutoresetMode.DISABLED:
            raise ResetNeeded(
                f"`step` was called while episode {int(np.argmax(before))} is over; call `reset` with a reset_mask"
            )
        tasks.step(np.asarray(actions))
        reward, terminated, truncated = tasks.reward, tasks.terminated, tasks.truncated
        info, final = tasks.info(), {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            begun = terminated | truncated
            final = self._final(begun, info) if begun.any() else {}
        else:
            begun = before  # their step did not count: it is their reset
            reward[begun], terminated[begun], truncated[begun] = 0.0, False, False
            self._ended = terminated | truncated
        for i in np.flatnonzero(begun):
            tasks.reset(int(i), self._rngs[i])
        return tasks.observation(), reward, terminated, truncated, self._step_info(info, begun) | final

    def _step_info(self, info: dict[str, np.ndarray], begun: np.ndarray) -> dict[str, Any]:
        """Return what is said of a step, with masks: where an episode has begun, what a reset says and no more."""
        said = {name: np.where(begun, value.dtype.type(0), value) for name, value in info.items()}
        masks = {f"_{name}": ~begun for name in info}
        for name, value in self.tasks.start_info.items():
            said[name][begun], masks[f"_{name}"] = value, np.ones(self.num_envs, bool)
        return said | masks

    def _final(self, ended: np.ndarray, info: dict[str, np.ndarray]) -> dict[str, Any]:
        """Return the last observation and info of the tasks that ended."""
        final_obs = np.full(self.num_envs, None, dtype=object)
        final_info = {name: value.copy() for name, value in info.items()}
        final_info |= {f"_{name}": ended.copy() for name in info}
        for i in np.flatnonzero(ended):
            final_obs[i] = self.tasks.observation(i)
        return {
            "final_obs": final_obs, "_final_obs": ended.copy(), "final_info": final_info, "_final_info": ended.copy(),
        }  # fmt: skip

    def state_entries(self) -> dict[str, Entry]:
        """List what decides the environment's future."""
        return {
            "tasks": of_object(self.tasks),
            "episodes": of_generators(self._rngs),
            "ended": of_array(self._ended, 0, 1),
        }

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
        """Return the tasks' pictures, uint8 (height, width, 3) each."""
        if self.render_mode is None:
            return None
        self._check_order("render")
        return tuple(self.tasks.picture(i) for i in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the native threads."""
        self.tasks.worlds.close()
        self._is_closed = True


def _autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode[mode.upper()] if isinstance(mode, str) else AutoresetMode(mode)
    except (KeyError, ValueError):
        names = ", ".join(one.name for one in AutoresetMode)
        raise InvalidInputError(f"autoreset_mode = {mode!r}; choose one of {names}") from None
