"""Reaching a robot to look at it tells it nothing; connecting tells it what it takes for a collision."""

from types import SimpleNamespace

import numpy as np
import pytest

from contactsafe.hardware import franka_port
from contactsafe.hardware.messages import reading_dtype


class Robot:
    """A robot that remembers what it was told."""

    told: list

    def __init__(self, address, realtime):
        Robot.told = []

    def read_once(self):
        vector = [0.1] * 7
        return SimpleNamespace(
            time=SimpleNamespace(to_sec=lambda: 1.0), q=vector, dq=vector, tau_J=vector, tau_J_d=vector,
            control_command_success_rate=1.0, robot_mode=1,
        )  # fmt: skip

    def __getattr__(self, name):
        return lambda *words: Robot.told.append(name)


@pytest.fixture
def port(monkeypatch):
    library = SimpleNamespace(
        Robot=Robot, RealtimeConfig=SimpleNamespace(kIgnore=0),
        NetworkException=ConnectionError, FrankaException=RuntimeError,
    )  # fmt: skip
    monkeypatch.setattr(franka_port, "_library", lambda: library)
    return franka_port.FrankaPort("172.16.0.2", (0.1, np.zeros(3), np.eye(3)))


def test_reaching_tells_nothing_and_reads_all(port):
    reading = np.zeros(1, reading_dtype(7))
    port.reach()
    port.look(reading)
    port.close()
    assert Robot.told == []
    np.testing.assert_array_equal(reading["q"][0], [0.1] * 7)


def test_connecting_tells_collision_and_load(port):
    port.connect()
    assert Robot.told == ["set_collision_behavior", "set_load"]
