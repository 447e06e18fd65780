"""Worlds whose controllers are called late, or see measurements that are lost, frozen or wrong; and a late policy."""

from collections.abc import Sequence

import numpy as np

from contactsafe.control.config import ControllerConfig
from contactsafe.control.tick import control_tick
from contactsafe.core.compiled import compiled
from contactsafe.experiments.collision_motions import Motion
from contactsafe.experiments.motions import Playback
from contactsafe.robot.arm import Arm
from contactsafe.sim import mujoco_backend
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.sensing import sense
from contactsafe.sim.stepping import begin_step, drive, end_step, end_tick
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds

SEEN, NO_CALL, LOST, FROZEN, VELOCITY_JUMPS, POSITION_JUMPS, NUDGED = range(7)
"""What may happen at a tick: nothing, the controller is not called, or its measurement is not what it should be."""

_JOINT = 1
_VELOCITY_RAD_S, _POSITION_RAD, _NUDGE_RAD = 0.2, 0.05, 1.2e-5


class LateWorlds(Worlds):
    """N worlds with `codes`, (n, ticks): what happens at each tick since reset, such as `FROZEN`.

    A controller that is not called leaves its last torque in force, as the robot itself does. Measurements carry their
    time where `timed`; a frozen one carries that of when it was taken.
    """

    def __init__(
        self, arm: Arm, worlds: Sequence[WorldConfig], controller: ControllerConfig, seeds: Sequence[int],
        codes: np.ndarray, timed: bool,
    ):  # fmt: skip
        super().__init__(arm, worlds, controller, len(worlds), seeds)
        self.codes, self.timed = np.asarray(codes, dtype=np.int64), timed
        self._held = np.zeros((len(worlds), 2 * arm.n + 7))

    def run(self, ticks: int | np.ndarray, trace: np.ndarray | None = None) -> None:
        """Run control ticks in every world; see `Worlds.run`."""
        ticks = self._checked(ticks, trace)
        traces = self.no_trace if trace is None else trace

        def chunk(start: int, stop: int) -> None:
            noise = self.sample_noise(start, stop)
            _run_late(
                start, stop, self.records, self.controllers, noise, ticks, self.metrics, self.samples, traces,
                self.codes, self.timed, self._held,
            )  # fmt: skip

        self.in_threads(chunk)


@compiled(nogil=True)
def _run_late(
    start: int, stop: int, worlds: np.ndarray, controllers: np.ndarray, noise: np.ndarray, ticks: np.ndarray,
    metrics: np.ndarray, samples: np.ndarray, traces: np.ndarray, codes: np.ndarray, timed: bool, held: np.ndarray,
) -> None:  # fmt: skip
    for i in range(start, stop):
        world, controller = worlds[i], controllers[i]
        begin_step(metrics[i], ticks[i])
        for k in range(ticks[i]):
            sense(world, controller, noise[i, k])
            code = codes[i, world.tick]
            controller.measurement.has_time = 1 if timed else 0
            controller.measurement.time = world.tick * controller.params.clock.dt
            _corrupt(controller.measurement, code, held[i])
            if code != NO_CALL:
                control_tick(controller)
            drive(world, controller, noise[i, k])
            mujoco_backend.write(world)
            mujoco_backend.step(world)
            mujoco_backend.read(world)
            end_tick(world, controller, metrics[i], samples[i], traces[i], k)
        end_step(metrics[i])


@compiled
def _corrupt(measurement: np.record, code: int, held: np.ndarray) -> None:
    """Make of a measurement what the controller sees; `held` has the last one as it was seen."""
    n = measurement.q.shape[0]
    if code == FROZEN:
        measurement.q[:], measurement.qd[:] = held[:n], held[n : 2 * n]
        measurement.wrench_ee[:], measurement.time = held[2 * n : 2 * n + 6], held[2 * n + 6]
    elif code == LOST:
        measurement.q[:] = np.nan
    elif code == VELOCITY_JUMPS:
        measurement.qd[_JOINT] += _VELOCITY_RAD_S
    elif code == POSITION_JUMPS:
        measurement.q[_JOINT] += _POSITION_RAD
    elif code == NUDGED:
        measurement.q[_JOINT] += _NUDGE_RAD
    elif code == SEEN:
        held[:n], held[n : 2 * n] = measurement.q, measurement.qd
        held[2 * n : 2 * n + 6], held[2 * n + 6] = measurement.wrench_ee, measurement.time


class LatePlayback(Playback):
    """Motions of which nothing is heard from one tick to another.

    Args:
        worlds: to play them in.
        motions: one for each.
        ticks: that all are played for.
        silent: first tick of the policy's silence and the first after it, one pair each.
    """

    def __init__(self, worlds: Worlds, motions: Sequence[Motion], ticks: int, silent: Sequence[tuple[int, int]]):
        super().__init__(worlds, motions)
        self.lengths[:] = ticks
        self._silent = silent

    def record(self) -> np.ndarray:
        """Play to the end; return `trace_dtype` records, (n, ticks)."""
        step = np.zeros((self.worlds.n, MAX_TICKS), dtype=trace_dtype(self.worlds.arm.n))
        pieces = []
        while self.running.any():
            ticks = self.step(step)
            pieces.append(step[:, :ticks].copy())
        return np.concatenate(pieces, axis=1)

    def _aim(self, i: int, time_s: float) -> None:
        start, stop = self._silent[i]
        late = start <= self.ticks < stop
        self._target["kept"][i] = late
        if not late:
            super()._aim(i, time_s)
