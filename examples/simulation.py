"""A simulated Panda under a controller of your choice, every millisecond recorded."""

from collections.abc import Callable

import numpy as np

import contactsafe as cs
from contactsafe.sim import WorldConfig, Worlds, trace_dtype

ARM = cs.robots.panda()
STIFFNESS = np.array([150.0] * 3 + [450.0] * 3)

Path = Callable[[float], np.ndarray]
"""Displacement of the target from where the tool starts, (3,), m, at a time in s."""


def simulate(
    config: cs.ControllerConfig,
    seconds: float,
    world: WorldConfig | None = None,
    path: Path | None = None,
    push: dict | None = None,
    start: np.ndarray | None = None,
) -> np.ndarray:
    """Hold or move the tool, and return `trace_dtype` records of what truly happened, one a millisecond, (T,).

    Args:
        config: of the controller.
        seconds: how long.
        world: plant, sensors, obstacles.
        path: of the target; None to hold the tool.
        push: arguments of `Worlds.push`.
        start: joint positions, (n,), rad; None for home.
    """
    start = ARM.home if start is None else start
    worlds = Worlds(ARM, world, config, seed=0)
    worlds.reset(0, start)
    if push:
        worlds.push(0, **push)
    pose, target = ARM.tool_pose(start), worlds.controllers[0]["target"]
    target["position"], target["quat"], target["q_posture"] = pose.position, pose.quat, start
    target["K_task"], target["D_task"] = STIFFNESS, 2 * np.sqrt(STIFFNESS)
    trace, pieces = np.zeros((1, 10), trace_dtype(ARM.n)), []
    for tick in range(0, round(1000 * seconds), 10):
        if path:
            target["position"] = pose.position + path(tick / 1000)
        worlds.run(10, trace)
        pieces.append(trace[0].copy())
    worlds.close()
    return np.concatenate(pieces)


def smooth(done: float) -> float:
    """Return a motion from 0 to 1 that starts and ends at rest."""
    done = min(max(done, 0.0), 1.0)
    return done**2 * (3.0 - 2.0 * done)
