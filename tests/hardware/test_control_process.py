"""However a control process ends, the robot is let go of, the state has a name, and the others are told."""

import os
import signal

import pytest

from contactsafe.hardware import heartbeats, states
from contactsafe.hardware.control_process import control
from contactsafe.hardware.port import RobotError, RobotSilentError


@pytest.fixture(autouse=True)
def own_signals():
    """Give this process its signals back."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def failing(error, at=200):
    def each(one, tick):
        if tick == at:
            raise error

    return each


ENDS = {
    "the robot stops by itself": (RobotError(("joint_reflex",), "aborted"), states.ROBOT_FAULT),
    "nothing comes from the robot": (RobotSilentError((), "timeout"), states.ROBOT_SILENT),
    "a mistake in the program": (ValueError("no such thing"), states.CONTROL_DEAD),
    "memory runs out": (MemoryError(), states.CONTROL_DEAD),
}


@pytest.mark.parametrize("end", ENDS)
def test_it_ends_by_name_and_lets_go_of_the_robot(bench, end, capfd):
    error, reason = ENDS[end]
    one = bench(failing(error))
    one.control()
    assert (one.status["state"], one.status["reason"]) == (states.FAULT, reason)
    assert one.status["finished"] == 1
    assert one.robot.calls[-2:] == ["finish", "close"]
    said = capfd.readouterr()
    assert type(error).__name__ in said.err or str(error) in said.out


def test_what_the_library_leaves_unnamed_the_robot_is_asked_for(bench, capfd):
    one = bench(failing(RobotError((), "control aborted")))
    one.robot.told = ("tau_j_range_violation",)
    one.control()
    assert "robot error: control aborted (tau_j_range_violation)" in capfd.readouterr().out


def test_a_run_that_is_called_off_before_it_begins_never_takes_the_robot(bench):
    one = bench()
    one.exchange.status["stop"] = states.ASKED
    one.exchange.status["go"] = 0
    control(str(one.exchange.path), one.settings)
    assert one.robot.calls == ["connect", "close"]
    assert one.status["state"] == states.STOPPED
    assert one.status["finished"] == 1


def test_a_run_whose_command_and_watchdog_die_before_it_begins_never_takes_the_robot(bench, monkeypatch):
    monkeypatch.setattr(heartbeats, "_ALONE_S", 0.1)
    one = bench()
    control(str(one.exchange.path), one.settings)
    assert one.robot.calls == ["connect", "close"]
    assert one.status["stop"] == states.COMMAND_DEAD
    assert one.status["finished"] == 1


@pytest.mark.parametrize(("number", "reason"), [(signal.SIGTERM, states.ASKED), (signal.SIGINT, states.TIME_UP)])
def test_a_signal_does_not_take_the_arm_out_of_control(bench, number, reason):
    """SIGTERM brings it to rest; SIGINT is the command's to answer, which has the same terminal."""

    def each(one, tick):
        if tick == 200:
            os.kill(os.getpid(), number)
        if tick == 600:
            one.exchange.ask_to_stop(states.TIME_UP)

    one = bench(each)
    one.control()
    assert (one.status["state"], one.status["reason"]) == (states.STOPPED, reason)
    assert one.robot.calls == ["connect", "begin", "finish", "close"]
