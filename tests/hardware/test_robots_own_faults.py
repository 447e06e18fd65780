"""What stops a Franka by itself, from a simulator that enforces it, in an environment of its own."""

import contextlib
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.hardware import crew_parts
from tests.hardware.faulty_port import FaultyPort

from contactsafe.control import presets
from contactsafe.hardware import states
from contactsafe.hardware.control_loop import ControlSettings
from contactsafe.hardware.control_process import control
from contactsafe.hardware.crew import Part, run_crew
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.franka_port import FrankaPort
from contactsafe.hardware.messages import reading_dtype
from contactsafe.hardware.port import RobotError
from contactsafe.hardware.watchdog import watch
from contactsafe.robot import robots

pytest.importorskip("pylibfranka")
franky_sim = pytest.importorskip("franky_sim")

pytestmark = pytest.mark.slow

WANTED, PORT = "franka-sim==1.1.7", 1337
ADDRESSES = [f"127.0.1.{number}" for number in range(1, 255)]
"""None that a simulated robot of ours listens at."""
SERVER = """
import logging
import sys
from franka_sim.franka_sim_server import FrankaSimServer
logging.basicConfig(level=logging.ERROR)
FrankaSimServer(
    host=sys.argv[1], enable_gripper=False, enforce_comm_constraints=True, enforce_motion_limits=True
).start()
"""


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """Make an environment for the simulator, whose NumPy and MuJoCo are older than ours."""
    folder = tmp_path_factory.mktemp("franka_sim")
    subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True)
    made = folder / "venv" / "bin" / "python"
    got = subprocess.run([made, "-m", "pip", "install", "-q", WANTED], capture_output=True, text=True)
    if got.returncode != 0:
        pytest.skip(f"{WANTED} cannot be installed: {got.stderr.strip().splitlines()[-1]}")
    return made


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """Copy franky-sim's arm with its meshes found from anywhere."""
    package, copy = Path(franky_sim.__file__).parent, tmp_path_factory.mktemp("model") / "fr3.xml"
    (found,), mesh = package.rglob("fr3.xml"), next(package.rglob("link0_0_vis.obj"))
    text = found.read_text()
    folder = text.partition('meshdir="')[2].partition('"')[0]
    copy.write_text(text.replace(f'meshdir="{folder}"', f'meshdir="{mesh.parent}"'))
    return copy


def free_address():
    """Find an address at which nobody listens, whoever else runs these tests now; each begins to look elsewhere."""
    first = os.getpid() % len(ADDRESSES)
    for address in ADDRESSES[first:] + ADDRESSES[:first]:
        with socket.socket() as trial:
            try:
                trial.bind((address, PORT))
            except OSError:
                continue
            return address
    return None


def answers(address):
    """Tell whether there is a robot; asked as a robot is, since a simulator takes any connection for a client."""
    port = FrankaPort(address)
    try:
        port.connect()
    except RobotError:
        return False
    finally:
        port.close()
    return True


@pytest.fixture(scope="module")
def simulator(python, model, tmp_path_factory):
    said, address = tmp_path_factory.mktemp("said") / "said", free_address()
    assert address is not None
    with open(said, "w") as file:
        environment = {**os.environ, "FR3_MJCF": str(model), "PYTHONPATH": ""}
        words = [python, "-c", SERVER, address]
        process = subprocess.Popen(words, env=environment, stdout=file, stderr=file)
    with contextlib.suppress(PermissionError):  # a robot's own computer waits for no program of this one
        os.setpriority(os.PRIO_PROCESS, process.pid, -10)
    until = time.monotonic() + 60.0
    while not answers(address):
        assert process.poll() is None, said.read_text()
        assert time.monotonic() < until
        time.sleep(0.2)
    yield address
    process.kill()
    process.wait()


def held(address, fault, seconds=1.5):
    """Hold the arm, while its port goes wrong; return how that ended."""
    arm, exchange = robots.fr3(), Exchange.create(7)
    reading, port = np.zeros(1, reading_dtype(7)), FrankaPort(address)
    port.connect()
    port.look(reading)
    port.close()
    q = reading["q"][0].copy()
    pose = arm.tool_pose(q)
    parts = [
        Part("watchdog", watch),
        Part("control", control, (ControlSettings(arm, presets.safe(), FaultyPort(address, fault)),)),
        Part("policy", crew_parts.holder, (pose.position, pose.quat, q)),
    ]
    return run_crew(exchange, parts, seconds)


def recover(address):
    port = FrankaPort(address)
    port.connect()
    port.recover()
    port.close()


FAULTS = {
    "jump": "controller_torque_discontinuity",
    "stall 25": "communication_constraints_violation",
    "stall 50": "communication_constraints_violation",
    "lose 21": "communication_constraints_violation",
    "runaway": "joint_velocity_violation",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_stops_the_robot_ends_the_run_by_name_and_a_person_can_recover_it(simulator, fault, capfd):
    for _ in range(3):  # on a busy machine the simulator is late as well, and a short stall is no loss
        ending = held(simulator, fault)
        if not ending.went_well:
            break
    said = capfd.readouterr().out
    assert (ending.state, ending.reason) == ("fault", states.REASONS[states.ROBOT_FAULT].name), said
    assert FAULTS[fault] in said
    assert "Traceback" not in said
    recover(simulator)
    assert any(
        held(simulator, "none", 0.3).went_well or recover(simulator) for _ in range(3)
    )  # a busy machine may lose more by itself


def test_nineteen_lost_commands_are_gone_on_with(simulator):
    assert any(held(simulator, "lose 19").went_well or recover(simulator) for _ in range(3))
