"""The older Panda's port against a library made up, that calls for each command as libfranka does."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware import panda_port
from contactsafe.hardware.messages import reading_dtype
from contactsafe.hardware.panda_port import PandaPort
from contactsafe.hardware.port import RobotError, RobotSilentError


class Seconds(float):
    def to_sec(self):
        return float(self)


class Torques:
    def __init__(self, values):
        self.values, self.finished = list(values), False


def finished(torques):
    torques.finished = True
    return torques


class Robot:
    """Calls for a command a cycle, until a motion is finished or something goes wrong."""

    def __init__(self, address, realtime):
        self.address, self.told, self.taken, self.recovered = address, [], [], False

    def set_collision_behavior(self, *limits):
        self.told.append(limits)

    def set_load(self, *load):
        self.told.append(load)

    def automatic_error_recovery(self):
        self.recovered = True

    def read_once(self):
        return self.state(0)

    def state(self, k):
        nothing = SimpleNamespace(joint_reflex=False)
        return SimpleNamespace(
            q=np.full(7, 0.1 * k), dq=np.zeros(7), tau_J=np.ones(7), tau_J_d=np.zeros(7), time=Seconds(0.001 * k),
            control_command_success_rate=1.0, robot_mode=2, current_errors=nothing, last_motion_errors=nothing,
        )  # fmt: skip

    def control(self, cycle, limit_rate, cutoff):
        assert (limit_rate, cutoff) == (False, 1000.0)
        for k in range(10):
            command = cycle(self.state(k), Seconds(0.001))
            self.taken.append(command.values)
            if command.finished:
                return
            if not np.isfinite(command.values).all():
                raise RuntimeError('libfranka: Move command aborted: motion aborted by reflex! ["joint_reflex"]')
        raise RuntimeError("libfranka: UDP receive: Timeout")


@pytest.fixture
def port(monkeypatch):
    library = SimpleNamespace(
        Robot=Robot, Torques=Torques, motion_finished=finished, RealtimeConfig=SimpleNamespace(kIgnore=1)
    )
    monkeypatch.setattr(panda_port, "_library", lambda: library)
    made = PandaPort("172.16.0.2", (0.1, np.zeros(3), np.eye(3)))
    made.connect()
    yield made
    made.close()


def test_cycles_follow_each_other_and_commands_arrive(port):
    reading = np.zeros(1, reading_dtype(7))
    port.begin()
    for k in range(5):
        began = time.perf_counter_ns()
        assert port.read(reading) == 1
        assert port.arrived_ns <= time.perf_counter_ns()
        assert k == 0 or port.arrived_ns >= began
        assert reading["time"][0] == pytest.approx(0.001 * k)
        assert (reading["q"][0] == 0.1 * k).all()
        port.write(np.full(7, float(k)))
    port.read(reading)
    robot = port._robot
    port.finish()
    assert robot.taken == [[float(k)] * 7 for k in range(5)] + [[0.0] * 7]


def test_a_robot_that_stops_by_itself_is_named_and_can_be_recovered(port):
    reading = np.zeros(1, reading_dtype(7))
    port.begin()
    port.read(reading)
    port.write(np.full(7, np.nan))
    with pytest.raises(RobotError) as caught:
        port.read(reading)
    assert caught.value.names == ("joint_reflex",)
    port.recover()
    assert port._robot.recovered


def test_a_robot_that_is_gone_is_silent(port):
    reading = np.zeros(1, reading_dtype(7))
    port.begin()
    for _ in range(10):
        port.read(reading)
        port.write(np.zeros(7))
    with pytest.raises(RobotSilentError, match="UDP receive"):
        port.read(reading)


def test_without_its_library_one_line_says_what_to_install():
    panda_port._library.cache_clear()
    with pytest.raises(InvalidInputError, match=r"install contactsafe\[panda\]$"):
        PandaPort("172.16.0.2")
