"""How well a policy does a task: held-out episodes, no exploration. No torch."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.results.metrics import CONTACT_N
from contactsafe.tasks.base.figures import FIGURES, EpisodeMetric, Episodes, Figure

HELD_OUT_SEED = 1_000_003
"""Added to the seeds of episodes that are never trained on."""


class Actor(Protocol):
    """What is evaluated; where it keeps state of an episode it also has `begin(i)`."""

    def act(self, observation: Mapping[str, Any]) -> np.ndarray:
        """Choose the actions for a batch of observations."""
        ...


def step_values(info: Mapping[str, Any], done: np.ndarray, key: str) -> np.ndarray:
    """Read one number per environment from a vector environment's info, the last of an episode where it ended.

    With AutoresetMode.SAME_STEP the top level of info already belongs to the next episode where one ended; what the
    ended one reported is under "final_info".

    Args:
        info: of `VectorEnv.step`.
        done: which environments ended an episode, (N,) bool.
        key: name of the number.

    Returns:
        Values, (N,) float64; 0 where the environment reported none.
    """
    values = np.zeros(len(done))
    if key in info:
        values[:] = np.asarray(info[key], dtype=np.float64)
    if done.any() and key in info.get("final_info", {}):
        values[done] = np.asarray(info["final_info"][key], dtype=np.float64)[done]
    return values


def episode_metrics(env: Any) -> tuple[EpisodeMetric, ...]:
    """Return the metrics that an environment declares, none where it declares none."""
    return tuple(getattr(getattr(env, "unwrapped", env), "episode_metrics", ()))


def figures_of(env: Any) -> tuple[Figure, ...]:
    """Return the figures that an environment declares, those of every task where it declares none."""
    return tuple(getattr(getattr(env, "unwrapped", env), "figures", FIGURES))


def side_by_side(episodes: int, most: int = 16) -> int:
    """Return how many environments an evaluation steps at a time: as many as divide the episodes, up to `most`.

    The episodes are then the same wherever so many are asked for.
    """
    return max(n for n in range(1, most + 1) if episodes % n == 0)


def check_autoreset(vec_env: VectorEnv) -> None:
    """Refuse an environment that does not reset in the step that ends an episode.

    Raises:
        InvalidInputError: so it is.
    """
    mode = vec_env.metadata.get("autoreset_mode")
    if mode != AutoresetMode.SAME_STEP:
        raise InvalidInputError(f"the environment resets by {mode}; make it with AutoresetMode.SAME_STEP")


def check_rate(policy: Actor, rate_hz: float = POLICY_RATE_HZ) -> None:
    """Refuse a policy that was trained to be asked more or less often than it will be.

    Raises:
        InvalidInputError: so it is.
    """
    trained = getattr(policy, "rate_hz", rate_hz)
    if trained != rate_hz:
        raise InvalidInputError(
            f"the policy acts at {trained:g} Hz, the environment steps at {rate_hz:g} Hz; give a policy trained so"
        )


def evaluate_policy(
    policy: Actor,
    vec_env: VectorEnv,
    episodes: int,
    seed: int,
    rate_hz: float = POLICY_RATE_HZ,
    on_episode: Callable[[dict], Any] | None = None,
) -> dict[str, Any]:
    """Run a policy over seeded episodes.

    Each environment runs the same number of episodes, so short ones are not counted more often than long ones.

    Args:
        policy: has `act(observation)` for a batch, and perhaps the `rate_hz` at which it is to be asked; where it
            keeps something in mind, `begin(i)` is called as an episode of environment i begins.
        vec_env: with AutoresetMode.SAME_STEP; its info has tool_force_n, is_success and what its metrics read.
        episodes: to run in all; rounded up to a multiple of vec_env.num_envs.
        seed: of the first reset; use one that training did not.
        rate_hz: environment steps a second, for the times.
        on_episode: called with the record of each episode as it ends, for a progress bar.

    Returns:
        A dict of the environment's figures, NaN where there is nothing to compute one from, and records: a dict per
        episode, by environment and then by time.

    Raises:
        InvalidInputError: episodes is below 1, the environment resets otherwise, or the policy was trained for
            another rate.
    """
    check_autoreset(vec_env)
    if episodes < 1:
        raise InvalidInputError(f"episodes = {episodes}; give 1 or more")
    check_rate(policy, rate_hz)
    run = _Run(policy, vec_env, -(-episodes // vec_env.num_envs), rate_hz, on_episode)
    run.reset(seed)
    while run.active.any():
        run.step()
    done = Episodes([record for records in run.records for record in records], np.concatenate(run.forces), run.steps)
    return {**{figure.name: figure.compute(done) for figure in figures_of(vec_env)}, "records": done.records}


class _Run:
    """An evaluation that is running."""

    def __init__(
        self,
        policy: Actor,
        env: VectorEnv,
        quota: int,
        rate_hz: float,
        on_episode: Callable[[dict], Any] | None,
    ):
        self.policy, self.env, self.quota, self.rate_hz = policy, env, quota, rate_hz
        self.on_episode = on_episode or (lambda record: None)
        self.begin = getattr(policy, "begin", lambda i: None)
        n = env.num_envs
        self.taken, self.peak, self.returns = np.zeros(n, int), np.zeros(n), np.zeros(n)
        self.records: list[list[dict]] = [[] for _ in range(n)]
        self.forces: list[np.ndarray] = []
        self.steps = 0

    @property
    def active(self) -> np.ndarray:
        """Which environments have episodes to run, (n,) bool."""
        return np.array([len(records) < self.quota for records in self.records])

    def reset(self, seed: int) -> None:
        self.observation, _ = self.env.reset(seed=seed)
        for k in range(self.env.num_envs):
            self.begin(k)

    def step(self) -> None:
        actions = self.policy.act(self.observation)
        self.observation, reward, terminated, truncated, info = self.env.step(actions)
        done, active = np.asarray(terminated) | np.asarray(truncated), self.active
        force = step_values(info, done, "tool_force_n")
        self.steps += int(active.sum())
        self.forces.append(force[active & (force > CONTACT_N)])
        self.taken, self.peak, self.returns = self.taken + 1, np.maximum(self.peak, force), self.returns + reward
        if (done & active).any():
            self._record(done, np.flatnonzero(done & active).tolist(), info)
        self.taken[done], self.peak[done], self.returns[done] = 0, 0.0, 0.0
        for k in np.flatnonzero(done).tolist():
            self.begin(k)

    def _record(self, done: np.ndarray, ended: list[int], info: Mapping[str, Any]) -> None:
        success = step_values(info, done, "is_success")
        metrics = {metric: step_values(info, done, metric.key) for metric in episode_metrics(self.env)}
        for i in ended:
            record = {
                "success": bool(success[i]),
                **{metric.name: metric.convert(values[i]) for metric, values in metrics.items()},
                "time_s": float(self.taken[i] / self.rate_hz),
                "peak_force_n": float(self.peak[i]),
                "return": float(self.returns[i]),
            }
            self.records[i].append(record)
            self.on_episode(record)
