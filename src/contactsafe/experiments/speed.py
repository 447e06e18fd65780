"""How fast this machine runs the parts, each as a median and as a ratio to bare physics of the same run."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contactsafe.compiled import compiled
from contactsafe.control.tick import control_tick, tick_at
from contactsafe.envs.config import WipingConfig
from contactsafe.envs.tasks import WipingTasks
from contactsafe.learning.policy import Policy
from contactsafe.robot.native import mj_step
from contactsafe.sim.camera import render_mask
from contactsafe.sim.world import MAX_TICKS

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
def _bare_physics(model, data, n):
    for _ in range(n):
        mj_step(model, data)


@compiled(nogil=True)
def _ticks(controller, n):
    for _ in range(n):
        control_tick(controller)


def measure_speed(bundle, progress: Callable[[int], object] | None = None) -> list[Speed]:
    """Time bare physics, physics with the tick, the tick, the mask, the policy and the environment, in turns.

    Args:
        bundle: loaded `Bundle`.
        progress: told of every round done.
    """
    one, many = _tasks(1), _tasks(_ENVS)
    policy = Policy(bundle, one.worlds.homography)
    parts = _parts(one, many, policy)
    times: dict[str, list[float]] = {name: [] for name in parts}
    for name, (run, _) in parts.items():
        run()
        del name
    for _ in range(ROUNDS):
        for name, (run, count) in parts.items():
            start = time.perf_counter()
            run()
            times[name].append((time.perf_counter() - start) / count * 1e6)
        if progress:
            progress(1)
    many.worlds.close()
    bare = float(np.median(times["bare physics, one tick"]))
    return [
        Speed(name, float(np.median(values)), float(np.min(values)), float(np.median(values)) / bare)
        for name, values in times.items()
    ]


def _tasks(n: int) -> WipingTasks:
    tasks = WipingTasks(WipingConfig(), n, seed=0)
    for i in range(n):
        tasks.reset(i, np.random.default_rng(i))
    return tasks


def _parts(one: WipingTasks, many: WipingTasks, policy: Policy) -> dict[str, tuple[Callable[[], object], int]]:
    """Name each part and give what runs it and how many times that is."""
    worlds, bare = one.worlds, _tasks(1).worlds
    plant, controller = worlds.plants[0], worlds.controllers[0]
    observation, batch = one.observation(0), many.observation()
    actions = np.zeros((_ENVS, 18))

    def tick_from_python():
        for _ in range(_TICKS):
            tick_at(worlds.controllers, 0)

    def run_physics_and_tick():
        for _ in range(_TICKS // MAX_TICKS):
            worlds.run(MAX_TICKS)

    def step_many():
        for i in range(_ENVS):
            if many.tasks["steps"][i] > 600:
                many.reset(i, np.random.default_rng(i))
        many.step(actions)

    return {
        "bare physics, one tick": (
            lambda: _bare_physics(bare.plants[0]["model"], bare.plants[0]["data"], _TICKS),
            _TICKS,
        ),
        "physics and control tick": (run_physics_and_tick, _TICKS),
        "control tick, compiled loop": (lambda: _ticks(controller, _TICKS), _TICKS),
        "control tick, called from Python": (tick_from_python, _TICKS),
        "mask, 128 × 128": (
            lambda: [render_mask(worlds.camera, worlds.cells[0], plant, worlds.masks[0]) for _ in range(50)],
            50,
        ),
        "policy, image to action": (lambda: [policy.act(observation) for _ in range(20)], 20),
        f"policy, batch of {_ENVS}, per image": (lambda: policy.act(batch), _ENVS),
        f"environment, {_ENVS} at a time, per step": (step_many, _ENVS),
    }
