"""What Franka's library says becomes names, and what a system does not grant becomes a line."""

import os
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware import franka_port, realtime, states
from contactsafe.hardware.messages import reading_dtype
from contactsafe.hardware.port import RobotError
from contactsafe.hardware.realtime import Realtime

libfranka = pytest.importorskip("pylibfranka")


def test_errors_of_the_robot_keep_their_names():
    text = 'libfranka: Move command aborted: motion aborted by reflex! ["joint_reflex", "tau_j_range_violation"]'
    with pytest.raises(RobotError) as caught, franka_port._named(libfranka):
        raise RuntimeError(text)
    assert caught.value.names == ("joint_reflex", "tau_j_range_violation")
    assert "aborted by reflex" in str(caught.value)


def test_a_library_that_is_missing_is_told_with_the_extra(monkeypatch):
    franka_port._library.cache_clear()
    monkeypatch.setitem(sys.modules, "pylibfranka", None)
    with pytest.raises(InvalidInputError, match=r"contactsafe\[franka\]"):
        franka_port.FrankaPort("127.0.0.1")
    franka_port._library.cache_clear()


def test_a_robot_that_is_not_there_is_told_in_one_line():
    port = franka_port.FrankaPort("127.0.0.9")
    with pytest.raises(RobotError) as caught:
        port.connect()
    assert "\n" not in str(caught.value)


def test_flags_that_are_set_are_named():
    class Errors:
        joint_reflex, cartesian_reflex, _hidden = True, False, True

    assert franka_port.error_names(Errors()) == ("joint_reflex",)


def test_what_is_not_granted_is_one_line_and_nothing_else_changes(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "not permitted")

    for name in ("sched_setscheduler", "sched_setaffinity"):
        monkeypatch.setattr(os, name, refuse)
    monkeypatch.setattr(realtime, "_lock_memory", refuse)
    (line,) = realtime.apply(Realtime(priority=80, cpu=0))
    assert "SCHED_FIFO" in line
    assert "processor 0" in line
    assert "locked memory" in line


def test_nothing_asked_for_is_nothing_refused():
    assert realtime.apply(Realtime(priority=0, cpu=-1, lock_memory=False)) == []


def test_every_reason_has_a_name_and_all_but_the_first_a_remedy():
    assert len({reason.name for reason in states.REASONS.values()}) == len(states.REASONS)
    for number, reason in states.REASONS.items():
        assert reason.remedy or number == states.NONE
        assert "\n" not in reason.remedy


def test_a_reading_is_filled_by_value():
    state = SimpleNamespace(
        time=SimpleNamespace(to_sec=lambda: 1.2340000001), q=[0.1] * 7, dq=[0.2] * 7, tau_J=[0.3] * 7,
        tau_J_d=[0.4] * 7, control_command_success_rate=0.97, robot_mode=2,
    )  # fmt: skip
    reading, port = np.zeros(1, reading_dtype(7)), franka_port.FrankaPort("127.0.0.1")
    port._fill(reading, state)
    assert reading["time"][0] == 0.0
    state.time.to_sec = lambda: 1.2360000001
    port._fill(reading, state)
    assert reading["time"][0] == 0.002
    assert (reading["torque"][0] == 0.3).all()
    assert (reading["commanded"][0] == 0.4).all()
    assert reading["mode"][0] == 2
