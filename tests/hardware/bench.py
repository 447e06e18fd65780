"""A robot of this process alone, and a control loop that runs on it, tick by tick, whatever a test does in between."""

import time

import numpy as np

from contactsafe.control import presets
from contactsafe.hardware.control_loop import ControlLoop, ControlSettings
from contactsafe.hardware.control_process import control
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.mailbox import publish
from contactsafe.hardware.messages import as_words, message_dtype
from contactsafe.hardware.port import RobotError
from contactsafe.hardware.realtime import Realtime
from contactsafe.robot import robots


class FakeRobot:
    """An FR3 without friction or sensors' errors, integrated by its nominal dynamics.

    Args:
        arm: its description.
        on_tick: called with the tick's number before each reading.
    """

    def __init__(self, arm, on_tick=lambda tick: None):
        self.arm, self.on_tick = arm, on_tick
        self.torque_rate = np.full(arm.n, 1.0)
        self.q, self.qd, self.time = arm.home.copy(), np.zeros(arm.n), 0.0
        self.motor, self.push, self.ticks = arm.dynamics(self.q, self.qd)["g"].copy(), np.zeros(arm.n), 0
        self.sent, self.calls, self.told = [], [], ()
        self.arrived_ns = 0

    def connect(self):
        self.calls.append("connect")

    def look(self, reading):
        self._fill(reading)

    def begin(self):
        self.calls.append("begin")

    def read(self, reading):
        self.ticks += 1
        self.on_tick(self.ticks)
        self.arrived_ns = time.perf_counter_ns()
        dynamics = self.arm.dynamics(self.q, self.qd)
        qdd = dynamics["M_inv"] @ (self.motor + self.push - dynamics["c"] - dynamics["g"])
        self.qd = self.qd + 1e-3 * qdd
        self.q = self.q + 1e-3 * self.qd
        self.time += 1e-3
        self._fill(reading)
        return 1

    def write(self, torque):
        self.sent.append(torque.copy())
        self.motor = torque + self.arm.dynamics(self.q, self.qd)["g"]

    def finish(self):
        self.calls.append("finish")

    def errors(self):
        return self.told

    def close(self):
        self.calls.append("close")

    def _fill(self, reading):
        row = reading[0]
        row["time"], row["q"], row["qd"], row["torque"] = self.time, self.q, self.qd, self.motor


class Bench:
    """A control loop over a `FakeRobot`, with a policy that keeps asking for a pose.

    Args:
        folder: for the shared memory.
        each: called with bench and tick before each reading.
        preset: of the controller.
    """

    def __init__(self, each=lambda bench, tick: None, preset="safe"):
        self.arm = robots.fr3()
        self.exchange = Exchange.create(self.arm.n)
        self.robot = FakeRobot(self.arm, lambda tick: self._tick(each, tick))
        rights = Realtime(0, -1, False)
        self.settings = ControlSettings(self.arm, presets.by_name(preset), self.robot, rights=rights)
        self.message = np.zeros(1, message_dtype(self.arm.n))
        self.words = as_words(self.message)
        self.pose, self.speaks, self.states, self.speeds = self.arm.tool_pose(self.arm.home), True, [], []

    @property
    def status(self):
        return self.exchange.status[0]

    def tell(self, tick, **changes):
        """Publish a good target made of a tick's state, but for some changes."""
        row = self.message[0]
        row["number"], row["of_tick"], row["joints"] = row["number"] + 1, tick, self.arm.n
        row["position"], row["quat"], row["q_posture"] = self.pose.position, self.pose.quat, self.arm.home
        row["K_task"], row["D_task"] = [150.0] * 3 + [450.0] * 3, [24.0] * 3 + [42.0] * 3
        for name, value in changes.items():
            row[name] = value
        publish(self.exchange.targets, self.words)

    def _tick(self, each, tick):
        status = self.exchange.status
        status["beat_watchdog"] += 1
        self.states.append((int(status["state"][0]), int(status["reason"][0])))
        self.speeds.append(float(status["tool_speed"][0]))
        if self.speaks and tick % 16 == 1:
            self.tell(int(status["tick"][0]))
        each(self, tick)

    def run(self, ticks):
        """Run so many ticks, then ask the loop to end; return when it has let go of the robot."""
        at = ticks

        def limit(inner):
            def called(tick):
                if tick == at:
                    self.exchange.ask_to_stop(8)
                if tick > at + 5000:
                    raise RobotError((), "the loop does not end")
                inner(tick)

            return called

        self.robot.on_tick = limit(self.robot.on_tick)
        ControlLoop(self.settings, self.exchange).run()

    def control(self):
        """Be the control process of a run that may begin at once."""
        self.exchange.status["go"] = 1
        control(str(self.exchange.path), self.settings)

    def close(self):
        self.exchange.unlink()
