"""Processes that are killed or frozen in the middle of a run over the protocol: it ends by name, and nothing is left.

In lockstep, so that a busy machine is no fault.
"""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from tests.hardware import crew_parts

from contactsafe.control import presets
from contactsafe.hardware import states
from contactsafe.hardware.control_loop import ControlSettings
from contactsafe.hardware.control_process import control
from contactsafe.hardware.crew import Part, run_crew
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.franka_port import FrankaPort
from contactsafe.hardware.messages import row_dtype
from contactsafe.hardware.realtime import Realtime
from contactsafe.hardware.recorder import record
from contactsafe.hardware.run_log import read_run
from contactsafe.hardware.watchdog import watch
from contactsafe.robot import robots
from contactsafe.sim.franka_process import SimulatedRobot
from contactsafe.sim.franka_scene import FrankaScene

pytest.importorskip("pylibfranka")
pytest.importorskip("franky_sim")

pytestmark = pytest.mark.slow


def alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


class Run:
    """A run that holds an arm, in which something happens after half a second."""

    def __init__(self, folder):
        self.arm, self.log = robots.fr3(), folder / "run.mcap"
        self.exchange, self.happened = Exchange.create(7), False
        self.exchange.status["lockstep"] = 1

    def parts(self, address):
        """Return the run's processes over the robot at an address."""
        rights, pose = Realtime(0, -1, False), self.arm.tool_pose(self.arm.home)
        settings = ControlSettings(self.arm, presets.safe(), FrankaPort(address), lockstep=True, rights=rights)
        return [
            Part("watchdog", watch),
            Part("recorder", record, (self.log, {"robot": "fr3", "task": "wiping"})),
            Part("control", control, (settings,)),
            Part("policy", crew_parts.holder, (pose.position, pose.quat, self.arm.home)),
        ]

    def go(self, happen, seconds=3.0):
        """Run, and let it happen once; return how it ended and the processes' numbers."""
        pids, robot = {}, SimulatedRobot(FrankaScene(robots.WIPER), self.arm.home, lockstep=True)

        def look(status):
            if status["tick"] > 500 and not self.happened:
                self.happened = True
                for name in ("control", "policy", "recorder", "watchdog"):
                    pids[name] = int(status[f"pid_{name}"])
                happen(pids, robot.process.pid)

        with robot:
            ending = run_crew(self.exchange, self.parts(robot.address), seconds, look)
            if robot.process.is_alive():
                os.kill(robot.process.pid, signal.SIGCONT)
        return ending, pids


def kill(name):
    return lambda pids, robot: os.kill(pids[name], signal.SIGKILL)


EVENTS = {
    "control killed": (kill("control"), "fault", {"control ended"}),
    "policy killed": (kill("policy"), "stopped", {"policy ended", "policy silent"}),
    "simulator killed": (lambda pids, robot: os.kill(robot, signal.SIGKILL), "fault", {"robot silent", "robot fault"}),
    "simulator frozen": (lambda pids, robot: os.kill(robot, signal.SIGSTOP), "fault", {"robot silent"}),
    "recorder killed": (kill("recorder"), "stopped", {"time is up"}),
    "watchdog killed": (kill("watchdog"), "stopped", {"time is up"}),
    "Ctrl-C": (lambda pids, robot: os.kill(os.getpid(), signal.SIGINT), "stopped", {"asked to stop"}),
}


@pytest.mark.parametrize("event", EVENTS)
def test_it_ends_by_name_and_nothing_is_left(event, tmp_path):
    happen, state, reasons = EVENTS[event]
    run = Run(tmp_path)
    ending, pids = run.go(happen)
    assert (ending.state, ending.reason in reasons) == (state, True), ending
    assert len(pids) == 4
    assert not [name for name, pid in pids.items() if alive(pid)]
    assert not run.exchange.path.exists()
    assert ending.largest_step_nm <= 0.9 + 1e-9


def test_what_a_recorder_wrote_before_it_was_killed_is_read(tmp_path):
    run = Run(tmp_path)
    ending, _ = run.go(kill("recorder"), seconds=2.0)
    _, rows = read_run(tmp_path / "run.mcap", row_dtype(7))
    assert len(rows) > 450
    assert (np.diff(rows["tick"]) == 1).all()
    assert ending.reason == states.REASONS[states.TIME_UP].name


def test_a_terminals_interrupt_reaches_all_processes_and_the_arm_is_brought_to_rest_all_the_same(tmp_path):
    """Ctrl-C goes to the whole group, the control process among them, which has an arm to stop."""
    words = [sys.executable, "-m", "contactsafe", "run", "--simulated", "--lockstep", "--alone", "--against", "none"]
    words += ["--task", "insertion", "--seconds", "3000", "--out", str(tmp_path / "out")]
    with open(tmp_path / "said", "w") as said:
        process = subprocess.Popen(words, stdout=said, stderr=said, start_new_session=True)
    try:
        while "running" not in (tmp_path / "said").read_text():
            assert process.poll() is None, (tmp_path / "said").read_text()
            time.sleep(0.2)
        os.killpg(process.pid, signal.SIGINT)
        code = process.wait(60.0)
    finally:
        process.kill()
    text = (tmp_path / "said").read_text()
    assert "asked to stop" in text, text
    assert "Traceback" not in text
    assert code == 0, text
    _, rows = read_run(tmp_path / "out" / "safe" / "run.mcap", row_dtype(7))
    assert np.linalg.norm(rows["output"]["velocity"][-1][:3]) < 0.01
