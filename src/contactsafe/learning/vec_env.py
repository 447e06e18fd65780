"""A task as Stable-Baselines3 sees it: N environments, observations already encoded and scaled."""

from collections import deque
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv
from stable_baselines3.common.vec_env import VecEnv

from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.core.state import Entry, check_state_dict, load_state_dict, of_array, of_object, state_dict
from contactsafe.policy.action_config import ACTION_SIZE
from contactsafe.policy.dither import Dither
from contactsafe.policy.observation import ObservationScaling
from contactsafe.policy.perception import Perception
from contactsafe.tasks.base.evaluation import check_autoreset, episode_metrics, step_values

_STILL = Dither(amplitude=0.0)

RECENT = 100
"""Finished episodes of which metrics are kept."""


class EncodedVecEnv(Independent, VecEnv):
    """Adapter from a Gymnasium VectorEnv with a dict of vectors, and perhaps a mask, to Stable-Baselines3.

    A time limit is reported as such (`TimeLimit.truncated` and `terminal_observation`), so PPO bootstraps there and
    takes only a true end for an end.

    Args:
        env: the VectorEnv; its autoreset mode is SAME_STEP.
        perception: `perception(masks, tool_positions)` returns latents; None where no images are seen.
        scaling: of the vectors and the latent.
        action_repeat: environment steps for which one action is given; their rewards are summed.
        reward_scale: rewards are multiplied by this; the metrics are not.
        dither: motion added to the actions.
        actions: how many of them are learned, from the first on; the others are 0.

    Attributes:
        finished: metrics of the last 100 episodes, a dict each: return, steps, success, force_mean_n, force_peak_n,
            the sum of each term of the reward, and the metrics that the environment declares.

    Raises:
        InvalidInputError: the environment resets in another mode, or action_repeat is below 1.
    """

    def __init__(
        self,
        env: VectorEnv,
        perception: Perception | None,
        scaling: ObservationScaling,
        action_repeat: int = 1,
        reward_scale: float = 1.0,
        dither: Dither = _STILL,
        actions: int = ACTION_SIZE,
    ):
        check_autoreset(env)
        if action_repeat < 1:
            raise InvalidInputError(f"action_repeat = {action_repeat}; give 1 or more")
        self.env = env
        self.perception = perception
        self.scaling = scaling
        self.action_repeat = action_repeat
        self.reward_scale = reward_scale
        self.dither = dither
        self.finished: deque[dict[str, Any]] = deque(maxlen=RECENT)
        box = gymnasium.spaces.Box(-scaling.clip, scaling.clip, (len(scaling.centre),), np.float32)
        super().__init__(env.num_envs, box, gymnasium.spaces.Box(-1.0, 1.0, (actions,), np.float32))
        self._actions = np.zeros((env.num_envs, ACTION_SIZE), np.float32)
        self._seed: int | None = None
        self._tally: dict[str, np.ndarray] = {}
        self._steps = np.zeros(self.num_envs, int)

    @property
    def metric_names(self) -> tuple[str, ...]:
        """Names of the metrics that the environment declares."""
        return tuple(metric.name for metric in episode_metrics(self.env))

    def _encode(self, observation: Mapping[str, Any]) -> np.ndarray:
        n = len(observation[self.scaling.observes[0]])
        latent = np.zeros((n, 0), np.float32)
        if self.perception is not None:
            latent = self.perception(observation["mask"], observation["pose"])
        return self.scaling(observation, latent)

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Seed the next reset; environment i gets its own seed from it."""
        self._seed = seed
        return [seed] * self.num_envs

    def reset(self) -> np.ndarray:
        """Start new episodes everywhere; observation (N, k)."""
        observation, _ = self.env.reset(seed=self._seed)
        self._seed = None
        self._tally = {}
        self._steps[:] = 0
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        return self._encode(observation)

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for step_wait."""
        self._actions = np.zeros((self.num_envs, ACTION_SIZE), np.float32)
        self._actions[:, : actions.shape[1]] = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step: observation (N, k), reward (N,), done (N,), one info dict each."""
        rewards = np.zeros(self.num_envs, np.float32)
        ended = np.zeros(self.num_envs, bool)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        actions = self.dither.over(self._actions, self._steps)
        for _ in range(self.action_repeat):
            observation, reward, terminated, truncated, info = self.env.step(actions)
            done = np.asarray(terminated) | np.asarray(truncated)
            # What the next episode earns while the others finish their repeats belongs to neither transition.
            rewards[~ended] += np.asarray(reward)[~ended]
            self._count(reward, done, info)
            if done.any():
                self._close(done, np.asarray(terminated), info, infos)
                ended |= done
                actions = np.where(ended[:, None], np.float32(0.0), actions)
        return self._encode(observation), self.reward_scale * rewards, ended, infos

    def _count(self, reward: Any, done: np.ndarray, info: Mapping[str, Any]) -> None:
        self._steps += 1
        force = step_values(info, done, "tool_force_n")
        sums = {"return": np.asarray(reward, float), "force_mean_n": force}
        terms = [k for k in (*info, *info.get("final_info", {})) if k.startswith("reward_")]
        sums |= {key: step_values(info, done, key) for key in terms}
        for key, value in sums.items():
            self._tally[key] = self._tally.get(key, 0.0) + value
        self._tally["force_peak_n"] = np.maximum(self._tally.get("force_peak_n", 0.0), force)

    def _close(
        self, done: np.ndarray, terminated: np.ndarray, info: Mapping[str, Any], infos: list[dict[str, Any]]
    ) -> None:
        success = step_values(info, done, "is_success")
        declared = {metric: step_values(info, done, metric.key) for metric in episode_metrics(self.env)}
        rows = np.flatnonzero(done)
        final = info["final_obs"]
        encoded = self._encode({k: np.stack([final[i][k] for i in rows]) for k in final[rows[0]]})
        for row, i in enumerate(rows):
            metrics: dict[str, Any] = {key: float(value[i]) for key, value in self._tally.items()}
            metrics |= {"steps": int(self._steps[i]), "success": bool(success[i])}
            metrics |= {metric.name: metric.convert(values[i]) for metric, values in declared.items()}
            metrics["force_mean_n"] /= metrics["steps"]
            self.finished.append(metrics)
            infos[i] = {
                "terminal_observation": encoded[row],
                "TimeLimit.truncated": not terminated[i],
                "is_success": metrics["success"],
                "episode": {"r": metrics["return"], "l": metrics["steps"], "t": 0.0},
            }
        for value in self._tally.values():
            value[done] = 0.0
        self._steps[done] = 0

    @property
    def keeps_worlds(self) -> bool:
        """Whether the environment below has a `state_dict`; without, a resumed run begins new episodes."""
        return hasattr(self.env.unwrapped, "state_dict")

    def state_entries(self) -> dict[str, Entry]:
        """List what decides the future, but for the observation that was given last."""
        worlds = {"worlds": of_object(self.env.unwrapped)} if self.keeps_worlds else {}
        return worlds | {
            "steps": of_array(self._steps, 0, 2**53),
            "tally": Entry(self._read_tally, self._write_tally, self._check_tally),
            "finished": Entry(lambda: list(self.finished), self._write_finished, _check_finished),
        }

    def state_dict(self) -> dict[str, Any]:
        """Return all that decides the future, as plain values and arrays."""
        return state_dict(self.state_entries())

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Load what `state_dict` returned; the seed kept for the next reset is forgotten."""
        load_state_dict(self.state_entries(), state)
        self._seed = None

    def check(self, state: Mapping[str, Any]) -> None:
        """Refuse a state that `load_state_dict` could not load.

        Raises:
            InvalidInputError: naming the entry that cannot be.
        """
        check_state_dict(self.state_entries(), state)

    def _read_tally(self) -> dict[str, np.ndarray]:
        return {key: value.copy() for key, value in self._tally.items()}

    def _write_tally(self, tally: Mapping[str, np.ndarray]) -> None:
        self._tally = {key: value.copy() for key, value in tally.items()}

    def _check_tally(self, tally: Mapping[str, Any]) -> None:
        sums = {name: of_array(np.zeros(self.num_envs, np.asarray(value).dtype)) for name, value in dict(tally).items()}
        check_state_dict(sums, tally)

    def _write_finished(self, episodes: list[dict[str, Any]]) -> None:
        self.finished.clear()
        self.finished.extend(episodes)

    def close(self) -> None:
        """Close the environment below, and the encoder's threads."""
        self.env.close()
        getattr(self.perception, "close", lambda: None)()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Read an attribute of the environment below, the same for each index."""
        value = None if attr_name == "render_mode" else getattr(self.env, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the environment below."""
        setattr(self.env, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the environment below, once."""
        return [getattr(self.env, method_name)(*args, **kwargs)]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Say whether single environments are wrapped: they are not, they are native."""
        return [False for _ in self._get_indices(indices)]


def _check_finished(episodes: Any) -> None:
    plain = isinstance(episodes, list) and len(episodes) <= RECENT and all(isinstance(one, dict) for one in episodes)
    if not plain or not all(isinstance(value, int | float) for one in episodes for value in one.values()):
        raise InvalidInputError(f"the state holds {shown(episodes)} for finished episodes; start anew")
