"""Whoever dies or stands still is noticed, and nobody is left behind."""

import signal
import subprocess
import sys
import time

import pytest

from contactsafe.hardware import states, watchdog
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.watchdog import Watchdog


class Scene:
    """A run whose processes only sleep, and a clock that the test turns."""

    def __init__(self, monkeypatch):
        self.exchange, self.now = Exchange.create(7), 100.0
        self.processes = {}
        for name in ("control", "policy", "recorder"):
            self.processes[name] = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
            self.exchange.status[f"pid_{name}"] = self.processes[name].pid
        self.exchange.status["state"] = states.RUNNING
        monkeypatch.setattr(watchdog.time, "monotonic", lambda: self.now)
        self.dog = Watchdog(self.exchange)
        self.beats = ["beat_control", "beat_policy", "beat_command"]

    def look(self, seconds=0.01):
        self.now += seconds
        for name in self.beats:
            self.exchange.status[name] += 1
        return self.dog.look()

    def kill(self, name):
        self.processes[name].kill()
        for _ in range(200):
            with open(f"/proc/{self.processes[name].pid}/stat") as file:
                if file.read().rpartition(")")[2].split()[0] == "Z":
                    return
            time.sleep(0.01)

    @property
    def stop(self):
        return int(self.exchange.status["stop"][0])

    def close(self):
        for process in self.processes.values():
            process.kill()
            process.wait()
        self.exchange.unlink()


@pytest.fixture
def scene(monkeypatch):
    made = Scene(monkeypatch)
    yield made
    made.close()


def test_a_run_in_which_all_live_is_left_alone(scene):
    assert not any(scene.look(0.05) for _ in range(50))
    assert scene.stop == 0
    assert scene.exchange.status["beat_watchdog"][0] == 50


def test_a_policy_that_dies_ends_the_run_by_name(scene):
    scene.look()
    scene.kill("policy")
    scene.look()
    assert scene.stop == states.POLICY_DEAD


def test_a_control_process_that_dies_is_a_fault_and_the_others_are_seen_off(scene):
    scene.look()
    scene.kill("control")
    scene.look()
    status = scene.exchange.status
    assert (status["state"][0], status["reason"][0]) == (states.FAULT, states.CONTROL_DEAD)
    assert not scene.look()  # policy and recorder may still finish
    scene.look(5.0)
    for name in ("policy", "recorder"):
        assert scene.processes[name].wait(5.0) == -signal.SIGKILL
    assert scene.look()


@pytest.mark.parametrize(("waits", "seconds", "reason"), [
    (0, 0.15, states.CONTROL_STUCK), (1, 0.15, 0), (1, 0.35, states.ROBOT_SILENT),
])  # fmt: skip
def test_a_control_loop_that_stands_still_is_told_from_a_robot_that_is_silent(scene, waits, seconds, reason):
    scene.look()
    scene.exchange.status["waits_for_robot"] = waits
    scene.beats.remove("beat_control")
    scene.look()
    scene.look(seconds)
    assert scene.stop == reason


@pytest.mark.parametrize("state", [states.STOPPING, states.FAULT])
def test_a_control_loop_that_hung_as_it_braked_hung_for_ever(scene, state):
    scene.look()
    scene.exchange.status["state"] = state
    scene.beats.remove("beat_control")
    scene.look()
    scene.look(0.15)
    assert scene.stop == states.CONTROL_STUCK
    scene.look(6.0)
    assert scene.processes["control"].wait(5.0) == -signal.SIGKILL


def test_the_time_that_it_took_to_begin_is_no_silence(scene):
    """Between getting ready and the first turn the loop does not beat; it does before it says that it runs."""
    scene.exchange.status["state"] = states.IDLE
    scene.beats.remove("beat_control")
    scene.look()
    scene.look(2.0)
    scene.exchange.status["beat_control"] += 1
    scene.exchange.status["state"] = states.RUNNING
    scene.look()
    assert scene.stop == 0


def test_in_lockstep_nothing_is_too_slow(scene):
    scene.exchange.status["lockstep"] = 1
    scene.look()
    scene.beats.remove("beat_control")
    scene.look(60.0)
    assert scene.stop == 0


def test_a_command_that_is_gone_ends_the_run(scene):
    scene.look()
    scene.beats.remove("beat_command")
    scene.look()
    scene.look(2.5)
    assert scene.stop == states.COMMAND_DEAD


def test_a_command_that_took_seconds_to_start_its_processes_ended_the_run(scene):
    """Each process reads what the user's program imports; the watchdog is there before the others."""
    scene.beats.remove("beat_command")
    scene.look()
    scene.look(30.0)
    assert scene.stop == 0
    scene.look(130.0)
    assert scene.stop == states.COMMAND_DEAD


def test_a_control_process_that_does_not_let_go_is_ended(scene):
    scene.look()
    scene.exchange.ask_to_stop(states.ASKED)
    scene.look(1.0)
    assert scene.processes["control"].poll() is None
    scene.look(6.0)
    assert scene.processes["control"].wait(5.0) == -signal.SIGKILL


def test_it_is_over_once_the_robot_is_let_go_of_and_all_are_gone(scene):
    scene.look()
    scene.exchange.status["finished"] = 1
    assert not scene.look()
    for name in scene.processes:
        scene.kill(name)
    assert scene.look()


def test_a_process_number_that_was_never_given_is_nobody(scene):
    scene.exchange.status["pid_policy"] = 0
    scene.look()
    assert scene.stop == 0
