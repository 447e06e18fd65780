"""How fast this machine runs the parts, each as a median and as a ratio to bare physics of the same run."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contactsafe.control.tick import control_tick, tick_at
from contactsafe.core.compiled import compiled
from contactsafe.core.native import mj_step
from contactsafe.experiments.task import Episodes, ExperimentTask
from contactsafe.policy.action_config import ACTION_SIZE
from contactsafe.policy.bundle import Bundle
from contactsafe.policy.policy import Policy
from contactsafe.sim.sensing import noise_channels
from contactsafe.sim.stepping import run_ticks
from contactsafe.sim.truth import sample_dtype

ROUNDS = 15
"""Times each part is timed."""

_TICKS = 510
_ENVS = 16


@dataclass(frozen=True)
class Speed:
    """How long one thing takes.

    Attributes:
        name: what was timed.
        median_us: median over rounds, µs each.
        best_us: fastest round, µs each.
        ratio: median over the median of bare physics in the same run.
    """

    name: str
    median_us: float
    best_us: float
    ratio: float


@compiled(nogil=True)
def _bare_physics(model: int, data: int, n: int) -> None:
    for _ in range(n):
        mj_step(model, data)


@compiled(nogil=True)
def _ticks(controller: np.record, n: int) -> None:
    controller.measurement.qd[:] = 0.0  # one that moves and never changes is not believed
    for _ in range(n):
        control_tick(controller)


def measure_speed(task: ExperimentTask, bundle: Bundle, progress: Callable[[int], object] | None = None) -> list[Speed]:
    """Time bare physics, physics with the tick, the tick, the task's parts, the policy and the episodes, in turns.

    Parts of one thread are timed by the processor time they take, so that other load on the machine counts less; the
    episodes, whose threads divide the cores between them, by the clock on the wall.

    Args:
        task: whose episodes are stepped.
        bundle: of its policy.
        progress: told of every round done.
    """
    episodes = {name: task.episodes("safe", range(n)) for name, n in (("one", 1), ("bare", 1), ("many", _ENVS))}
    parts = _parts(episodes, Policy(bundle, episodes["one"].camera_homography), bundle.sees)
    times: dict[str, list[float]] = {part.name: [] for part in parts}
    for timed in (False, *[True] * ROUNDS):
        for of_kind in episodes.values():
            of_kind.begin()
        for part in parts:
            start = part.clock()
            part.run()
            if timed:
                times[part.name].append((part.clock() - start) / part.count * 1e6)
        if timed and progress:
            progress(1)
    episodes["many"].worlds.close()
    bare = float(np.median(times[parts[0].name]))
    return [
        Speed(name, float(np.median(values)), float(np.min(values)), float(np.median(values)) / bare)
        for name, values in times.items()
    ]


@dataclass(frozen=True)
class _Part:
    name: str
    run: Callable[[], object]
    count: int
    clock: Callable[[], float] = time.thread_time


def _parts(episodes: dict[str, Episodes], policy: Policy, sees: bool) -> list[_Part]:
    """Return each part, what runs it and how many times that is; bare physics comes first."""
    one, many = episodes["one"], episodes["many"]
    worlds, bare = one.worlds, episodes["bare"].worlds
    seen = "image" if sees else "observation"
    actions = np.zeros((_ENVS, ACTION_SIZE))

    noise = np.random.default_rng(0).standard_normal((_TICKS, noise_channels(one.arm.n)))
    samples = np.zeros(_TICKS, dtype=sample_dtype)
    plant = bare.records[0]["plant"]

    def physics_and_tick() -> None:
        run_ticks(
            worlds.records[0], worlds.controllers[0], noise, _TICKS, worlds.metrics[0], samples, worlds.no_trace[0],
        )  # fmt: skip

    def tick_from_python() -> None:
        worlds.controllers["measurement"]["qd"] = 0.0
        for _ in range(_TICKS):
            tick_at(worlds.controllers, 0)

    def act() -> None:
        for _ in range(20):
            policy.act(one.observation())

    def environment() -> None:
        for _ in range(10):
            many.step(actions)

    return [
        _Part(
            "bare physics, one tick",
            lambda: _bare_physics(plant["model"], plant["data"], _TICKS),
            _TICKS,
        ),
        _Part("physics and control tick", physics_and_tick, _TICKS),
        _Part("control tick, compiled loop", lambda: _ticks(worlds.controllers[0], _TICKS), _TICKS),
        _Part("control tick, called from Python", tick_from_python, _TICKS),
        *(_Part(name, _repeated(run, times), times) for name, (run, times) in one.timed().items()),
        _Part(f"policy, {seen} to action", act, 20),
        _Part(f"policy, batch of {_ENVS}, per {seen}", lambda: policy.act(many.observation()), _ENVS),
        _Part(f"environment, {_ENVS} at a time, per step", environment, 10 * _ENVS, time.perf_counter),
    ]


def _repeated(run: Callable[[], object], times: int) -> Callable[[], object]:
    def repeat() -> None:
        for _ in range(times):
            run()

    return repeat
