"""What the environments of any task have in common, one task or many."""

import copy
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.action_config import ACTION_SIZE
from contactsafe.policy.observation import Observation
from contactsafe.policy.rate import POLICY_RATE_HZ
from contactsafe.robot.arm import Arm
from contactsafe.robot.calibration import Calibration
from contactsafe.tasks.base.config import TaskConfig
from contactsafe.tasks.base.figures import EpisodeMetric, Figure
from contactsafe.tasks.base.registry import backend_of, task_by_name
from contactsafe.tasks.base.tasks import Tasks

_RENDER_MODES = ["rgb_array"]


class Environment(Independent):
    """Tasks, their limits and spaces, and Gymnasium's order of calls.

    Copies, pickled or not, have worlds of their own and go on from where the original is.
    """

    metadata: dict[str, Any] = {"render_modes": _RENDER_MODES, "render_fps": POLICY_RATE_HZ}
    _spec: EnvSpec | None = None
    _was_reset = _is_closed = False
    tasks: Tasks

    def _make(
        self,
        task: str | type[Tasks],
        num_envs: int,
        config: TaskConfig | None,
        engine: str,
        arm: Arm | Calibration | None,
        render_mode: str | None,
        max_episode_steps: int | None,
    ) -> tuple[gymnasium.spaces.Dict, gymnasium.spaces.Box]:
        """Make the tasks; return the spaces of one."""
        kind = task_by_name(task).simulation if isinstance(task, str) else task
        modes = _RENDER_MODES if kind.picture is not Tasks.picture else []
        if render_mode is not None and render_mode not in modes:
            choice = (
                f"choose {' or '.join(modes)}, or None" if modes else f"task '{kind.name}' has no picture, give None"
            )
            raise InvalidInputError(f"render_mode = {render_mode!r}; {choice}")
        self.metadata = {**self.metadata, "render_modes": modes}
        if max_episode_steps is not None and max_episode_steps < 1:
            raise InvalidInputError(
                f"max_episode_steps = {max_episode_steps}; give 1 or more, or None for the config's"
            )
        self.render_mode = render_mode
        self.tasks = kind(config, num_envs, arm=arm, backend=backend_of(engine))
        if max_episode_steps is not None:
            self.tasks.step_limit = int(max_episode_steps)
        vectors = {
            vector.name: gymnasium.spaces.Box(-np.inf, np.inf, (vector.size,), np.float32)
            for vector in self.tasks.observation_vectors
        }
        observation = gymnasium.spaces.Dict({**vectors, **self.tasks.own_spaces()})
        return observation, gymnasium.spaces.Box(-1.0, 1.0, (ACTION_SIZE,), np.float32)

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium made it from; its `max_episode_steps` is that of the task."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        """Keep a copy: Gymnasium's registry is not to be changed."""
        self._spec = copy.copy(spec)
        if self._spec is not None and self._spec.max_episode_steps is None:
            self._spec.max_episode_steps = self.tasks.step_limit

    @property
    def observation_vectors(self) -> tuple[Observation, ...]:
        """What policies may observe beside images."""
        return self.tasks.observation_vectors

    @property
    def episode_metrics(self) -> tuple[EpisodeMetric, ...]:
        """What an evaluation records of an episode."""
        return self.tasks.episode_metrics

    @property
    def figures(self) -> tuple[Figure, ...]:
        """Of an evaluation."""
        return self.tasks.figures

    @property
    def camera_homography(self) -> np.ndarray | None:
        """Plane coordinates (x, y, 1), m, to pixels (u, v, w) of the task's camera, (3, 3); None without one."""
        return self.tasks.camera_homography

    def _check_order(self, doing: str) -> None:
        if self._is_closed:
            raise ClosedEnvironmentError(f"`{doing}` was called after `close`; make the environment anew")
        if doing != "reset" and not self._was_reset:
            raise ResetNeeded(f"`{doing}` was called before `reset`; call `reset` first")

    def _options(self, options: Mapping[str, Any] | None, *others: str) -> dict[str, Any]:
        """Return the options of a reset that the task takes; refuse what is not known."""
        known = (*self.tasks.reset_options, *others)
        unknown = [str(name) for name in options or {} if name not in known]
        if unknown:
            raise InvalidInputError(
                f"reset options hold {', '.join(unknown)}; known are {', '.join(known) or 'none'}; leave others out"
            )
        return {name: value for name, value in (options or {}).items() if name in self.tasks.reset_options}


def seed_of(seed: Any) -> int | None:
    """Return a seed as Gymnasium's generators want it, NumPy's whole numbers too.

    Raises:
        InvalidInputError: it is no whole number, or negative.
    """
    if seed is None:
        return None
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InvalidInputError(f"seed = {seed!r}; give a whole number, 0 or more, or None")
    return int(seed)
