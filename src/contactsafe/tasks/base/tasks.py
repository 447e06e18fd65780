"""N tasks of a kind stepped together: what all tasks have, and what each supplies."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np

from contactsafe.control import presets
from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError, UnreachableError
from contactsafe.core.state import Entry, load_state_dict, of_generators, of_object, of_records, state_dict
from contactsafe.policy.action import act
from contactsafe.policy.action_config import ACTION_SIZE, action_limits
from contactsafe.policy.observation import Observation, check_fields
from contactsafe.policy.rate import POLICY_RATE_HZ, ticks_of_step
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm, Pose
from contactsafe.robot.calibrated import arm_for
from contactsafe.robot.calibration import Calibration
from contactsafe.robot.ik import InverseKinematics
from contactsafe.robot.ik_few_joints import FEW
from contactsafe.robot.posture import posture_rule
from contactsafe.robot.soundness import array_of
from contactsafe.sim.backend import Backend
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.worlds import Worlds
from contactsafe.tasks.base.config import TaskConfig
from contactsafe.tasks.base.figures import FIGURES, EpisodeMetric, Figure
from contactsafe.tasks.base.pushes import PushSchedule
from contactsafe.tasks.base.record import observe_one, task_dtype


class Tasks(Independent):
    """N tasks of a kind, stepped together; a task is a subclass, see docs/howto/own_task.md.

    The first ones of a kind in a process compile what a step needs, or load it, which is said when it takes long. A
    copy, pickled or not, has worlds of its own and goes on from where these are.

    Args:
        config: of the task; None for its defaults.
        n: how many.
        seed: of the sensors' noise; what an episode samples comes from the generator given to `reset`.
        worlds: one configuration for each task in place of `config.world`, such as obstacles of its own.
        arm: that works; None for the task's own, or what was identified of that.
        backend: what computes the physics in place of MuJoCo; see `contactsafe.sim.backend`.

    Attributes:
        config: of the task.
        arm: that works.
        worlds: the simulation below.
        tasks: array of `task_dtype` records, (n,).
        step_limit: policy steps of an episode.
    """

    name: ClassVar[str]
    """What the task is called, as in `--task NAME`."""

    config_type: ClassVar[type[TaskConfig]] = TaskConfig
    reward_terms: ClassVar[tuple[str, ...]] = ()
    """Names of the reward's terms; each is reported in `info` as `reward_<name>`."""

    own_fields: ClassVar[tuple[tuple[Any, ...], ...]] = ()
    """Fields of the task's records beyond those of `task_dtype`."""

    own_bounds: ClassVar[dict[str, tuple[float, float]]] = {}
    """What fields that index something may be, both ends included."""

    episode_metrics: ClassVar[tuple[EpisodeMetric, ...]] = ()
    """Numbers of an episode, recorded and logged beside success, time and force."""

    figures: ClassVar[tuple[Figure, ...]] = FIGURES
    """Of an evaluation, in the order in which they are shown."""

    reset_options: ClassVar[tuple[str, ...]] = ()
    """Names of the options that `reset` takes."""

    place: ClassVar[str] = "the place of work"
    """Field of the configuration that says where the tool works, for messages."""

    start_info: ClassVar[dict[str, float]] = {}
    """What `info` says of an episode that begins."""

    def __init__(
        self,
        config: TaskConfig | None = None,
        n: int = 1,
        seed: int | Sequence[int] | None = None,
        worlds: Sequence[WorldConfig] | None = None,
        arm: Arm | Calibration | None = None,
        backend: Callable[..., Backend] | None = None,
    ):
        self.config = self._checked(config)
        self.arm = arm_for(arm, self.default_arm)
        self._backend = backend
        self._ik = InverseKinematics(self.arm)
        for pose in self.reached():
            self.posture_over(pose)
        controller = presets.by_name(self.config.controller)
        furnished = [self.furnish(world) for world in worlds or [self.config.world] * n]
        self.worlds = Worlds(self.arm, furnished, controller, n, seed, shared=not self.varies, backend=backend)
        self.tasks = np.zeros(n, dtype=task_dtype(self.reward_terms, self.own_fields))
        self._pushes = None if self.config.pushes is None else PushSchedule(self.worlds, self.config.pushes)
        self.step_limit = round(self.config.episode_s * POLICY_RATE_HZ)
        self._limits = action_limits(self.config.action, self.centre)
        self._actions = np.zeros((n, ACTION_SIZE))
        self._rule = posture_rule(self.arm)
        self._observed = tuple(vector.name for vector in self.observation_vectors)
        check_fields(self.observation_vectors, self.tasks.dtype)
        self.prepare()
        _warm_up(self)

    # What a task supplies.

    @property
    def centre(self) -> tuple[float, float, float]:
        """Point that the bounds of x_d are about, world, m."""
        raise NotImplementedError

    @property
    def varies(self) -> bool:
        """Whether episodes change the worlds' models."""
        return False

    def default_arm(self) -> Arm:
        """Return the arm that works where none is given."""
        return robots.panda()

    def reached(self) -> Sequence[Pose]:
        """Return poses of the tool that the task needs; an arm that does not reach them is refused."""
        return ()

    def furnish(self, world: WorldConfig) -> WorldConfig:
        """Return a world with what the task needs in it."""
        return world

    @property
    def observation_vectors(self) -> tuple[Observation, ...]:
        """Fields of the records that policies observe, in order, and at which scale."""
        raise NotImplementedError

    def prepare(self) -> None:
        """Make what the task needs beyond worlds and records."""

    def begin_episode(self, i: int, rng: np.random.Generator, options: Mapping[str, Any]) -> Pose:
        """Sample the episode of task i, change its world, and return where its tool starts."""
        raise NotImplementedError

    def after_reset(self, i: int, rng: np.random.Generator) -> None:
        """Fill the own fields of task i's record; its world has been reset."""

    def finish_step(self, start: int, stop: int) -> None:
        """Score and observe the step that tasks start to stop have run; compiled, without the GIL."""
        raise NotImplementedError

    def own_entries(self) -> dict[str, Entry]:
        """List what decides the task's future beyond worlds, records and pushes; put back before them."""
        return {}

    def own_info(self) -> dict[str, np.ndarray]:
        """Return figures of the last step by name, arrays (n,)."""
        return {}

    def own_observation(self, i: Any) -> dict[str, np.ndarray]:
        """Return what policies observe beside vectors, such as pictures, of tasks i."""
        return {}

    def own_spaces(self) -> dict[str, gymnasium.Space]:
        """Return their spaces."""
        return {}

    def picture(self, i: int) -> np.ndarray:
        """Return a picture of task i, uint8 (height, width, 3); a task without one cannot be rendered."""
        raise NotImplementedError

    # What every task has.

    def reset(self, i: int, rng: np.random.Generator, **options: Any) -> None:
        """Begin an episode in task i.

        Args:
            i: which task.
            rng: samples the episode.
            options: some of `reset_options`.
        """
        q = self.posture_over(self.begin_episode(i, rng, options))
        self.worlds.reset(i, q, self.config.action.stiffness_first)
        if self._pushes is not None:
            self._pushes.begin(i, rng)
        task = self.tasks[i]
        task["steps"], task["success"], task["failed"] = 0, 0, 0
        observe_one(self.worlds.controllers, self.tasks, i)
        self.after_reset(i, rng)

    def posture_over(self, pose: Pose) -> np.ndarray:
        """Return the joint positions that go with a tool pose, those of the target's posture, (n,), rad.

        Raises:
            UnreachableError: there are none.
        """
        try:
            q = self._ik.solve(pose)
            if self.arm.n < FEW and np.abs(self.arm.tool_pose(q).quat @ pose.quat) < _UPRIGHT:
                raise UnreachableError("the position alone is reached")
            return q
        except UnreachableError:
            where = ", ".join(f"{x:.3f}" for x in pose.position)
            raise UnreachableError(
                f"task '{self.name}' needs the tool at [{where}] m, pointing down, where arm '{self.arm.name}' does "
                f"not reach; change {self.place} of {self.config_type.__name__}, or give the arm another base"
            ) from None

    def step(self, actions: np.ndarray, traces: np.ndarray | None = None) -> None:
        """Run one policy step in every task.

        Args:
            actions: (n, 18) in [−1, 1]; clipped.
            traces: `trace_dtype` records to fill, (n, 17); None to record nothing.

        Raises:
            InvalidInputError: wrong shape, or not finite.
        """
        actions = array_of(actions, self._actions.shape, "actions")
        if not np.isfinite(actions).all():
            raise InvalidInputError(
                "actions hold a number that is not finite; give finite ones, of which those outside [-1, 1] are clipped"
            )
        self._actions[:] = actions
        if self._pushes is not None:
            self._pushes.step()
        ticks = ticks_of_step(self.tasks["steps"])
        self.before_step()

        def run(start: int, stop: int) -> None:
            act(start, stop, self.worlds.controllers, self._limits, self._rule, self._actions)
            self.worlds.run_some(start, stop, ticks, traces)
            self.finish_step(start, stop)

        self.worlds.in_threads(run)

    def before_step(self) -> None:
        """Take in what was changed from outside since the last step."""

    def observation(self, i: Any = slice(None)) -> dict[str, np.ndarray]:
        """Return what the policies observe, copied: vectors float32 (n, k), and the task's own."""
        shape = self.tasks["steps"][i].shape
        vectors = {name: self.tasks[name][i].astype(np.float32).reshape(*shape, -1) for name in self._observed}
        return {**vectors, **self.own_observation(i)}

    @property
    def reward(self) -> np.ndarray:
        """Sum of the reward's terms of the last step, (n,)."""
        return self.tasks["reward"].sum(axis=1)

    @property
    def terminated(self) -> np.ndarray:
        """Whether the task is done or cannot be done any more, (n,)."""
        return (self.tasks["success"] == 1) | (self.tasks["failed"] == 1)

    @property
    def truncated(self) -> np.ndarray:
        """Whether time is up, (n,)."""
        return ~self.terminated & (self.tasks["steps"] >= self.step_limit)

    @property
    def camera_homography(self) -> np.ndarray | None:
        """Plane coordinates (x, y, 1), m, to pixels (u, v, w) of the task's camera, (3, 3); None without one."""
        return None

    def info(self) -> dict[str, np.ndarray]:
        """Return the reward's terms and the step's figures by name, arrays (n,)."""
        tasks = self.tasks
        terms = {f"reward_{name}": tasks["reward"][:, k].copy() for k, name in enumerate(self.reward_terms)}
        return terms | {
            **self.own_info(),
            "tool_force_n": tasks["force_peak"].copy(),
            "tool_force_mean_n": tasks["force_mean"].copy(),
            "is_success": tasks["success"] == 1,
        }

    def state_entries(self) -> dict[str, Entry]:
        """List what decides the tasks' future, in the order in which it must be put back."""
        pushes = {} if self._pushes is None else {"pushes": of_generators(self._pushes.rngs)}
        objects = {**pushes, "worlds": of_object(self.worlds)}
        return {**self.own_entries(), **objects, "tasks": of_records(self.tasks, self.own_bounds)}

    def state_dict(self) -> dict[str, Any]:
        """Return all that decides the tasks' future, as plain values and arrays."""
        return state_dict(self.state_entries())

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Load a state; see `Worlds.load_state_dict`."""
        load_state_dict(self.state_entries(), state)

    def _checked(self, config: TaskConfig | None) -> Any:
        kind = self.config_type
        if config is not None and not isinstance(config, kind):
            raise InvalidInputError(
                f"config is {type(config).__name__}; give a {kind.__name__} ({kind.__module__}), such as "
                f"{kind.__name__}(episode_s=10.0)"
            )
        return config or kind()

    def compile_key(self) -> tuple[Any, ...]:
        """Return what decides which code a step compiles."""
        return (type(self), self.arm.n)

    def scratch(self) -> "Tasks":
        """Make one task alike to warm up with."""
        return type(self)(self.config, 1, arm=self.arm, backend=self._backend)


_UPRIGHT = 0.99996
"""Cosine of half the angle, 1°, by which a tool may be turned from what a task needs."""

_WARM: set[tuple[Any, ...]] = set()
"""Kinds of tasks whose step this process has compiled or loaded."""


def _warm_up(tasks: Tasks) -> None:
    """Run a step of a task of our own: the first step in a process compiles or loads for a long time."""
    key = tasks.compile_key()
    if key in _WARM:
        return
    _WARM.add(key)
    scratch = tasks.scratch()
    scratch.reset(0, np.random.default_rng(0))
    scratch.step(np.zeros((1, ACTION_SIZE)))
    scratch.worlds.close()
