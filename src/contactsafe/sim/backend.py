"""What a physics engine must do to carry a world: reset, read, write, step. MuJoCo's compiled form does the same.

`mujoco_backend` has `read`, `write` and `step` as compiled functions of a `world_dtype` record; a class that follows
`Backend` takes the same record from Python. Sensors, controller, metrics and tasks do not tell one from the other.
"""

from typing import NamedTuple, Protocol

import numpy as np

from contactsafe.core.compiled import compiled
from contactsafe.sim.stepping import begin_step, begin_tick, end_step, end_tick


class Backend(Protocol):
    """One arm and what stands about it, in some engine."""

    def reset(self, q: np.ndarray) -> None:
        """Put the arm at rest at q (n,) rad, its motors carrying its nominal weight; all else is as it was built."""

    def read(self, world: np.void) -> None:
        """Fill `truth` of a `world_dtype` record, all of it; `base_wrench` where the world has a sensor for it."""

    def write(self, world: np.void) -> None:
        """Take the torques for the next tick: `motor` less `drag`, N m, and the `push`; fill `pushed`."""

    def step(self) -> None:
        """Advance by one tick."""

    def place_fixture(self, name: str, position: np.ndarray, quat: np.ndarray) -> None:
        """Put a fixture elsewhere, world, m and w x y z, from the next reset on."""

    def set_tip_friction(self, friction: float) -> None:
        """Give the tool's tip another Coulomb coefficient, from the next reset on."""

    def close(self) -> None:
        """Release what the engine holds."""


class StepArrays(NamedTuple):
    """What a step of n worlds reads and writes, in the order of `run_worlds`.

    Attributes:
        records, controllers: `world_dtype` and `controller_dtype` records, (n,).
        noise: standard normal numbers, (n, at least ticks, `noise_channels`).
        ticks: how many each world runs, (n,).
        metrics: `step_metrics_dtype` records, (n,).
        samples, traces: `sample_dtype` and `trace_dtype` records, (n, at least ticks); traces may be (n, 0).
    """

    records: np.ndarray
    controllers: np.ndarray
    noise: np.ndarray
    ticks: np.ndarray
    metrics: np.ndarray
    samples: np.ndarray
    traces: np.ndarray


def run_backend(backend: Backend, i: int, arrays: StepArrays) -> None:
    """Run ticks[i] ticks of world i in a backend."""
    records, controllers, noise, ticks, metrics, samples, traces = arrays
    world = records[i]
    _begin_step(metrics, i, ticks)
    for k in range(ticks[i]):
        _begin_tick(records, controllers, noise, i, k)
        backend.write(world)
        backend.step()
        backend.read(world)
        _end_tick(records, controllers, metrics, samples, traces, i, k)
    _end_step(metrics, i)


@compiled(nogil=True)
def _begin_step(metrics, i, ticks):
    begin_step(metrics[i], ticks[i])


@compiled(nogil=True)
def _end_step(metrics, i):
    end_step(metrics[i])


@compiled(nogil=True)
def _begin_tick(worlds, controllers, noise, i, k):
    begin_tick(worlds[i], controllers[i], noise[i, k])


@compiled(nogil=True)
def _end_tick(worlds, controllers, metrics, samples, traces, i, k):
    end_tick(worlds[i], controllers[i], metrics[i], samples[i], traces[i], k)
