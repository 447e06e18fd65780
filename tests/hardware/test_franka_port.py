"""Franka's own client library against the simulated robot, cycle by cycle."""

import os
import threading

import numpy as np
import pytest

from contactsafe.hardware.franka_port import FrankaPort
from contactsafe.hardware.messages import reading_dtype
from contactsafe.hardware.port import RobotError
from contactsafe.robot import robots
from contactsafe.robot.franka import WIPER
from contactsafe.sim.franka_process import SimulatedRobot
from contactsafe.sim.franka_scene import FrankaScene

pytest.importorskip("pylibfranka")
pytest.importorskip("franky_sim")

pytestmark = pytest.mark.slow

ARM = robots.fr3(WIPER)


@pytest.fixture
def robot():
    with SimulatedRobot(FrankaScene(WIPER), ARM.home, lockstep=True) as made:
        yield made


@pytest.fixture
def port(robot):
    made = FrankaPort(robot.address, (0.1, np.array([0.0, 0.0, 0.1]), 1e-4 * np.eye(3)))
    made.connect()
    yield made
    made.close()


def test_a_robot_at_rest_says_where_it_is_and_what_holds_it(port):
    reading = np.zeros(1, reading_dtype(7))
    port.look(reading)
    assert np.abs(reading["q"][0] - ARM.home).max() < 1e-3
    assert np.abs(reading["qd"]).max() < 0.05
    gravity = ARM.dynamics(ARM.home, np.zeros(7))["g"]
    assert np.abs(reading["torque"][0] - gravity).max() < 3.0  # another model of the same arm


def test_whoever_connects_keeps_its_priority(port):
    """What libfranka takes, every process begun later would have as well: all of a run would be in each other's way."""
    port.begin()
    assert os.sched_getscheduler(0) == os.SCHED_OTHER
    reading = np.zeros(1, reading_dtype(7))
    port.read(reading)
    port.write(np.zeros(7))
    port.finish()


def test_cycles_follow_each_other_by_the_robots_clock_and_commands_arrive(port):
    reading, told = np.zeros(1, reading_dtype(7)), []
    port.begin()
    wave = 0.1 * np.arange(7.0)
    for k in range(100):
        passed = port.read(reading)
        told.append((passed, float(reading["time"][0]), reading["commanded"][0].copy()))
        port.write(np.sin(0.05 * k) * wave)
    port.finish()
    times = np.array([time for _, time, _ in told])
    assert times[0] == 0.0
    np.testing.assert_allclose(np.diff(times[1:]), 1e-3, atol=1e-9)
    for k in range(3, 100):  # a command shows in the state after the next
        np.testing.assert_allclose(told[k][2], np.sin(0.05 * (k - 1)) * wave, atol=1e-12)


def test_after_the_end_the_robot_can_be_taken_over_again(port):
    reading = np.zeros(1, reading_dtype(7))
    for _ in range(2):
        port.begin()
        for _ in range(5):
            port.read(reading)
            port.write(np.zeros(7))
        port.finish()
    port.look(reading)
    assert np.isfinite(reading["q"]).all()


def test_a_command_that_is_not_finite_is_refused_before_it_is_sent(port):
    reading = np.zeros(1, reading_dtype(7))
    port.begin()
    port.read(reading)
    with pytest.raises(RobotError) as caught:
        port.write(np.full(7, np.nan))
    assert "\n" not in str(caught.value)
    port.write(np.zeros(7))
    port.finish()


def test_a_robot_that_goes_is_told_within_seconds(robot, port):
    reading, ended = np.zeros(1, reading_dtype(7)), []
    port.begin()
    port.read(reading)
    robot.process.kill()

    def cycles():
        for _ in range(10):
            port.read(reading)
            port.write(np.zeros(7))

    def wait():
        with pytest.raises(RobotError):
            cycles()
        ended.append(True)

    waiter = threading.Thread(target=wait)
    waiter.start()
    waiter.join(30.0)
    assert ended
    assert port.errors() == ()
