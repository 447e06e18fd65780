"""N wiping tasks stepped together: what the single and the vector environment share."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from contactsafe.control import presets
from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.state import Entry, load_state_dict, of_generators, of_object, of_records, state_dict
from contactsafe.policy.action import DOWN
from contactsafe.policy.action_config import ACTION_SIZE, action_limits
from contactsafe.robot import robots
from contactsafe.robot.arm import Pose
from contactsafe.robot.ik import InverseKinematics
from contactsafe.robot.posture import posture_rule
from contactsafe.robot.soundness import array_of
from contactsafe.sim.camera import camera_at
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.drawings import paint_board
from contactsafe.sim.ink import nearest_ink
from contactsafe.sim.variation import Variation
from contactsafe.sim.world import POLICY_RATE_HZ, Worlds, ticks_of_step
from contactsafe.tasks.base.pushes import Pusher
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.step import REWARD_TERMS, VECTORS, observe, rewards_dtype, step_tasks, task_dtype


def _image_source(config: WipingConfig, worlds: Worlds):
    """Return what looks at the worlds in place of their own masks, if anything; OpenCV is loaded for it alone."""
    if config.image_source == "mask":
        return None
    from contactsafe.tasks.wiping.photographs import PhotographSource

    return PhotographSource(worlds)


def _checked(config: WipingConfig | None) -> WipingConfig:
    if config is not None and not isinstance(config, WipingConfig):
        raise InvalidInputError(
            f"config is {type(config).__name__}; give a WipingConfig (contactsafe.tasks.wiping.config), such as "
            "WipingConfig(episode_s=10.0)"
        )
    return config or WipingConfig()


class WipingTasks(Independent):
    """Boards to be wiped, N at a time.

    The first ones of a kind in a process compile what a step needs, or load it, which is said when it takes long. A
    copy, pickled or not, has worlds of its own and goes on from where these are.

    Args:
        config: of the task.
        n: how many.
        seed: of the sensors' noise; boards and starts are drawn from the generator given to `reset`.
        worlds: one configuration for each task in place of `config.world`, such as obstacles of its own.

    Attributes:
        worlds: the simulation below.
        tasks: array of `task_dtype` records, (n,).
        step_limit: policy steps of an episode.
    """

    world_type: type[Worlds] = Worlds
    """What simulates; another engine's tasks name theirs."""

    varies = True
    """Whether episodes may differ by more than what is drawn on the board."""

    def __init__(
        self,
        config: WipingConfig | None = None,
        n: int = 1,
        seed: int | Sequence[int] | None = None,
        worlds: Sequence[WorldConfig] | None = None,
    ):
        self.config = _checked(config)
        self.arm = robots.panda()
        controller = presets.by_name(self.config.controller)
        ranges = self.config.randomisation
        if ranges is not None and not self.varies:
            raise InvalidInputError("randomisation is given, and this engine knows none; leave it out, or use MuJoCo")
        own_models = {} if ranges is None else {"shared": False}
        self.worlds = self.world_type(self.arm, worlds or self.config.world, controller, n, seed, **own_models)
        self._variation = None if ranges is None else Variation(self.worlds, ranges)
        self._pusher = None if self.config.pushes is None else Pusher(self.worlds, self.config.pushes)
        self.tasks = np.zeros(n, dtype=task_dtype)
        self._images = _image_source(self.config, self.worlds)
        self.step_limit = round(self.config.episode_s * POLICY_RATE_HZ)
        self._limits = action_limits(self.config.action, self.config.world.board.centre)
        self._rewards = np.zeros(1, dtype=rewards_dtype)
        for name in (*REWARD_TERMS, "force_limit_n", "gentle_n"):
            self._rewards[name] = getattr(self.config.reward, name)
        self._rewards["clean_fraction"] = self.config.clean_fraction
        self._actions = np.zeros((n, ACTION_SIZE))
        self._ik = InverseKinematics(self.arm)
        self._rule = posture_rule(self.arm)
        _warm_up(self)

    def reset(self, i: int, rng: np.random.Generator, drawing: np.ndarray | None = None, start=None) -> None:
        """Begin an episode in task i.

        Args:
            i: which task.
            rng: draws board and start.
            drawing: ink to put on the board, true where ink is, (n, n); drawn at random where None.
            start: tool position, (3,), m; drawn at random where None.
        """
        config, worlds = self.config, self.worlds
        board = worlds.boards[i]
        board.clear()
        if drawing is None:
            paint_board(board, config.boards, rng)
        else:
            board.draw(drawing)
        if start is None:
            reach = config.start_reach
            start = np.add(
                config.world.board.centre, [*rng.uniform(-reach, reach, 2), rng.uniform(*config.start_height)]
            )
        if self._variation is not None:
            self._variation.draw(i, rng)
        worlds.reset(i, self.posture_over(Pose(np.asarray(start, dtype=float), DOWN)))
        if self._pusher is not None:
            self._pusher.begin(i, rng)
        controller = worlds.controllers[i]
        target = controller["target"]
        target["K_task"] = config.action.stiffness_start
        target["D_task"] = 2.0 * np.sqrt(target["K_task"])
        controller["output"]["position"] = controller["dynamics"]["position"]
        controller["output"]["rotation"] = controller["dynamics"]["rotation"]
        task = self.tasks[i]
        plant = worlds.plants[i]
        worlds.enter_ink(i)
        ink, distance = nearest_ink(
            worlds.ink_index, i, worlds.cells[i], plant["origin"], plant["cell"], controller["output"]["position"]
        )
        task["steps"], task["ink_start"], task["ink"], task["distance"] = 0, ink, ink, distance
        task["clean"], task["arm_touched"] = 0, 0
        task["light"] = 0 if self._images is None else rng.integers(2**31)
        self._look_first(i)

    def observe(self, i: int) -> None:
        """Look again at world i, after its board was changed by hand."""
        self.worlds.enter_ink(i)
        self._look_first(i)

    def _look_first(self, i: int) -> None:
        worlds, task = self.worlds, self.tasks[i]
        camera = camera_at(worlds.cameras, worlds.plants[i]["camera"])
        observe(worlds.plants[i], worlds.controllers[i], camera, worlds.ink_index.shown[i], task, worlds.masks[i])
        if self._images is not None:
            self._images.look(i, i + 1, self.tasks)
        if self._variation is not None:
            self._variation.look_first(i)

    def state_entries(self) -> dict[str, Entry]:
        """List what decides the tasks' future."""
        entries = {} if self._variation is None else {"variation": of_object(self._variation)}
        if self._pusher is not None:
            entries["pushes"] = of_generators(self._pusher.rngs)
        return {**entries, "worlds": of_object(self.worlds), "tasks": of_records(self.tasks, {"light": (0, 2**31)})}

    def state_dict(self) -> dict[str, Any]:
        """Return all that decides the tasks' future, as plain values and arrays."""
        return state_dict(self.state_entries())

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Load a state of tasks made alike; see `Worlds.load_state_dict`."""
        load_state_dict(self.state_entries(), state)

    def posture_over(self, pose: Pose) -> np.ndarray:
        """Give the joint positions that go with a tool pose, those of the target's posture, (n,), rad."""
        return self._ik.solve(pose)

    def step(self, actions: np.ndarray, traces: np.ndarray | None = None) -> None:
        """Run one policy step in every task.

        Args:
            actions: (n, 18) in [−1, 1]; clipped.
            traces: `trace_dtype` records to fill, (n, 17); None to record nothing.

        Raises:
            InvalidInputError: wrong shape, or not finite.
        """
        worlds = self.worlds
        actions = array_of(actions, self._actions.shape, "actions")
        if not np.isfinite(actions).all():
            raise InvalidInputError("actions hold a number that is not finite; every action must be in [-1, 1]")
        self._actions[:] = actions
        if self._pusher is not None:
            self._pusher.step()
        ticks = np.where(self.tasks["steps"] % 3 == 2, ticks_of_step(2), ticks_of_step(0))
        self._advance(ticks, worlds.no_trace if traces is None else traces)

    def _advance(self, ticks: np.ndarray, traces: np.ndarray) -> None:
        """Run one policy step of so many ticks, (n,), under `self._actions`, and look."""
        worlds = self.worlds
        worlds.enter_changed()

        def share(start: int, stop: int) -> None:
            noise = worlds.sample_noise(start, stop)
            step_tasks(
                start, stop, worlds.plants, worlds.controllers, worlds.cells, noise, ticks, worlds.reports, traces,
                worlds.cameras, worlds.ink_index, self._limits, self._rule, self._actions, self._rewards[0],
                self.tasks, worlds.masks,
            )  # fmt: skip
            self._look(start, stop)

        worlds.in_threads(share)

    def _look(self, start: int, stop: int) -> None:
        """Make of the masks of tasks start to stop what the policy is to see of them."""
        if self._images is not None:
            self._images.look(start, stop, self.tasks)
        if self._variation is not None:
            self._variation.look(start, stop)

    def observation(self, i=slice(None)) -> dict[str, np.ndarray]:
        """Give what the policies see, copied: pose, target, force float32 (n, 6), (n, 18), (n, 3); mask uint8."""
        return {
            **{name: self.tasks[name][i].astype(np.float32) for name in VECTORS},
            "mask": self.worlds.masks[i][..., None].copy(),
        }

    @property
    def reward(self) -> np.ndarray:
        """Sum of the reward's terms of the last step, (n,)."""
        return self.tasks["reward"].sum(axis=1)

    @property
    def terminated(self) -> np.ndarray:
        """Whether the board is clean or the arm has met the table, (n,)."""
        return (self.tasks["clean"] == 1) | (self.tasks["arm_touched"] == 1)

    @property
    def truncated(self) -> np.ndarray:
        """Whether time is up, (n,)."""
        return ~self.terminated & (self.tasks["steps"] >= self.step_limit)

    def info(self) -> dict[str, np.ndarray]:
        """Give the reward's terms and the episode's figures by name, arrays (n,)."""
        tasks = self.tasks
        terms = {f"reward_{name}": tasks["reward"][:, k].copy() for k, name in enumerate(REWARD_TERMS)}
        return terms | {
            "ink_left": tasks["ink"] / np.maximum(tasks["ink_start"], 1),
            "tool_force_n": tasks["force_peak"].copy(),
            "tool_force_mean_n": tasks["force_mean"].copy(),
            "is_success": tasks["clean"] == 1,
            "arm_touched": tasks["arm_touched"] == 1,
        }


_WARM: set[tuple] = set()
"""Kinds of tasks whose step this process has compiled or loaded."""


def _warm_up(tasks: WipingTasks) -> None:
    """Wipe for one step on a board of our own: the first step in a process compiles or loads for a long time."""
    kind = next(kind for kind in type(tasks).__mro__ if kind.__module__.startswith("contactsafe."))
    config = tasks.config
    sort = (kind, config.image_source, config.randomisation is not None)
    if sort in _WARM:
        return
    _WARM.add(sort)
    scratch = kind(replace(config, boards="strokes"), 1)
    scratch.reset(0, np.random.default_rng(0))
    scratch.step(np.zeros((1, ACTION_SIZE)))
    scratch.worlds.close()
