"""The control loop in Python: everything is compiled and allocated before, then it runs at the robot's rate."""

import contextlib
import gc
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from contactsafe.control.config import ControllerConfig
from contactsafe.control.controller import Controller
from contactsafe.control.records import controller_dtype
from contactsafe.control.signals import Target
from contactsafe.core.copying import Unique
from contactsafe.hardware import realtime
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.loop import loop_dtype, turn
from contactsafe.hardware.port import RobotError, RobotPort
from contactsafe.hardware.states import IDLE, RUNNING
from contactsafe.hardware.status import BUSY_BINS
from contactsafe.robot.arm import Arm

_STIFFNESS = np.array([150.0, 150.0, 150.0, 450.0, 450.0, 450.0])
"""With which the arm is held before the policy's first target, 1/s²."""


@dataclass(frozen=True)
class ControlSettings:
    """What the control process is told.

    Attributes:
        arm: that is controlled, with its tool.
        config: of the controller; friction compensation and torque rate are set for the robot, see `for_robot`.
        port: of the robot, not yet connected.
        lockstep: it waits for the policy's targets, so that a run is the same again.
        rights: priority, processor and memory, where the system grants them.
    """

    arm: Arm
    config: ControllerConfig
    port: RobotPort
    lockstep: bool = False
    rights: realtime.Realtime = field(default_factory=realtime.Realtime)


_RATE = 0.9
"""Of what a robot lets a torque change in a tick, that is used."""


def for_robot(config: ControllerConfig) -> ControllerConfig:
    """Return a configuration for a robot that adds gravity and its motors' friction itself, and checks torque rates."""
    return config.with_(friction_compensation=False, torque_rate_fraction=_RATE)


class ControlLoop(Unique):
    """The loop, made and warmed up before the robot is taken over.

    Args:
        settings: as given.
        exchange: of the run.
    """

    _why = "a control loop drives one robot; make another one"

    def __init__(self, settings: ControlSettings, exchange: Exchange):
        self.settings, self.exchange, self.port = settings, exchange, settings.port
        n = settings.arm.n
        self.controller = Controller(settings.arm, for_robot(settings.config))
        self.loops = np.zeros(1, loop_dtype(n))
        self._reading = self.loops["reading"]
        self._arguments: Any = ()
        self._bind()
        self._warm_up()

    def _bind(self) -> None:
        """See the records that the loop's turn works on, so that a turn allocates nothing."""
        exchange, loop = self.exchange, self.loops
        words = loop.view(np.int64).reshape(-1)
        fields = loop.dtype.fields
        message, seen = (
            words[fields[name][1] // 8 : fields[name][1] // 8 + fields[name][0].itemsize // 8]
            for name in ("message", "seen")
        )
        records = self.controller._records.view(controller_dtype(self.settings.arm.n))
        self._arguments = (
            records, loop, exchange.status, exchange.targets, message, exchange.seen, seen, exchange.ticks,
        )  # fmt: skip

    def _warm_up(self) -> None:
        """Run the turn on records that drive nothing, then forget what it did."""
        arm, status = self.settings.arm, self.exchange.status.copy()
        boxes = [box.copy() for box in (self.exchange.targets, self.exchange.seen)]
        rows = self.exchange.ticks[:8].copy()
        self.begin_at(arm.home, np.zeros(arm.n))
        records, loops, _, _, message, _, seen, _ = self._arguments
        for _ in range(300):
            self._reading["time"] += 0.001
            turn(records, loops, status, boxes[0], message, boxes[1], seen, rows)
        self.begin_at(arm.home, np.zeros(arm.n))

    def begin_at(self, q: np.ndarray, qd: np.ndarray) -> None:
        """Forget everything; the arm is at q, (n,), rad, and is to stay there."""
        arm, controller = self.settings.arm, self.controller
        controller.reset(q, qd)
        controller.set_target(Target(arm.tool_pose(q), _STIFFNESS, None, q))
        self.loops[:] = np.zeros((), self.loops.dtype)
        self.loops["step_limit"] = _RATE * self.port.torque_rate
        self.loops["gate"]["state"] = RUNNING
        reading = self._reading
        reading["q"], reading["qd"] = q, qd
        reading["torque"] = arm.dynamics(q, qd)["g"]

    def run(self) -> None:
        """Take the robot over, and control it until the run ends."""
        port, status = self.port, self.exchange.status
        port.look(self._reading)
        self.begin_at(self._reading["q"][0].copy(), np.zeros(self.settings.arm.n))
        self._note_beginning()
        gc.collect()
        gc.freeze()
        gc.disable()
        port.begin()
        status["beat_control"] += 1  # before: from RUNNING on the watchdog counts
        status["state"] = RUNNING
        try:
            self._cycle()
        finally:
            with contextlib.suppress(RobotError):  # whatever happened: a robot that is still there holds itself
                port.finish()

    def _note_beginning(self) -> None:
        """Put where the run begins into the recorder's ring, as tick 0."""
        row, record, status = self.exchange.ticks[0], self.controller.record, self.exchange.status
        row["tick"], row["stamp"], row["state"] = 0, time.time_ns(), IDLE
        row["measurement"], row["target"] = record["measurement"], record["target"]
        status["rows"] = 1

    def _cycle(self) -> None:
        """Turn until the run has ended; views of single numbers are made before, for they cost a microsecond each."""
        port, loops, status, reading = self.port, self.loops, self.exchange.status, self._reading
        arguments, sent, busy = self._arguments, loops["sent"][0], status["busy"][0]
        stamp, busy_ns, ticks, done = (loops[name] for name in ("stamp", "busy_ns", "tick", "done"))
        lost, waits = status["lost"], status["waits_for_robot"]
        clock, wall, lockstep = time.perf_counter_ns, time.time_ns, self.settings.lockstep
        while not done[0]:
            waits[0] = 1
            passed = port.read(reading)
            waits[0] = 0
            stamp[0] = wall()
            turn(*arguments)
            if lockstep:
                self._wait_for_policy()
            port.write(sent)
            busy_ns[0] = spent = clock() - port.arrived_ns
            busy[min(spent // 1000, BUSY_BINS - 1)] += 1
            if passed > 1 and ticks[0] > 1:
                lost[0] += passed - 1

    def _wait_for_policy(self) -> None:
        """Wait until the policy has seen this tick, where a run is to be the same again."""
        status = self.exchange.status
        while status["ready_policy"][0] < status["tick"][0] and status["stop"][0] == 0:
            time.sleep(0)
