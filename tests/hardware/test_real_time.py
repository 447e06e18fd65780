"""The same processes by the clock: whatever this machine's load makes of it, what has to hold holds."""

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
from contactsafe.logs.robot_run import torques_again
from contactsafe.robot import robots
from contactsafe.sim.franka_process import SimulatedRobot
from contactsafe.sim.franka_scene import FrankaScene

pytest.importorskip("pylibfranka")
pytest.importorskip("franky_sim")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Hold the arm for two seconds of the clock; return how that ended, the log and the truth."""
    folder, arm, exchange = tmp_path_factory.mktemp("real_time"), robots.fr3(), Exchange.create(7)
    pose = arm.tool_pose(arm.home)
    with SimulatedRobot(FrankaScene(robots.WIPER), arm.home, lockstep=False, truth=folder / "truth.npy") as robot:
        settings = ControlSettings(arm, presets.safe(), FrankaPort(robot.address), rights=Realtime(0, -1, False))
        parts = [
            Part("watchdog", watch),
            Part("recorder", record, (folder / "run.mcap", {"robot": "fr3", "task": "wiping", "controller": "safe"})),
            Part("control", control, (settings,)),
            Part("policy", crew_parts.holder, (pose.position, pose.quat, arm.home)),
        ]
        ending = run_crew(exchange, parts, 2.0)
    assert not exchange.path.exists()
    return ending, folder / "run.mcap", np.load(folder / "truth.npy")


def test_it_ends_in_a_state_with_a_name(run):
    """On a machine that is too slow it may end early, but never without saying why."""
    ending, _, _ = run
    assert ending.state in ("stopped", "fault")
    assert ending.reason in {reason.name for number, reason in states.REASONS.items() if number != states.NONE}
    assert ending.went_well or ending.remedy


def test_no_torque_changed_faster_than_it_may(run):
    ending, log, _ = run
    _, rows = read_run(log, row_dtype(7))
    assert np.abs(np.diff(rows["sent"], axis=0)).max() <= 0.9 + 1e-9
    assert max(ending.first_step_nm, ending.largest_step_nm) <= 0.9 + 1e-9


def test_every_tick_is_in_the_log_and_computed_again_is_the_same(run):
    ending, log, _ = run
    again = torques_again(log)
    assert again.ticks == ending.ticks
    assert again.same == again.ticks


def test_the_arm_never_fell(run):
    _, _, truth = run
    heights = truth["position"][:, 2]
    assert np.ptp(heights[: len(heights) // 2]) < 0.05
