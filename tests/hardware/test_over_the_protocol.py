"""All processes against a simulated Franka over its own network protocol, tick by tick: the same again, bit by bit."""

import os

import numpy as np
import pytest

from contactsafe.cli import main
from contactsafe.hardware.messages import row_dtype
from contactsafe.hardware.run_log import read_run
from contactsafe.logs.reading import read_log
from contactsafe.logs.robot_run import torques_again
from contactsafe.sim.franka_meetings import GOES_S

pytest.importorskip("pylibfranka")
pytest.importorskip("franky_sim")
pytest.importorskip("pyrealsense2", exc_type=ImportError)  # or without libusb

pytestmark = pytest.mark.slow

RUN = ["run", "--simulated", "--lockstep", "--against", "none", "--seed", "2"]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Run the wiping policy twice for four seconds of the robot's time."""
    folders = [tmp_path_factory.mktemp("run") for _ in range(2)]
    codes = [main([*RUN, "--seconds", "4", "--out", str(folder)]) for folder in folders]
    assert codes == [0, 0]
    return [folder / "safe" for folder in folders]


def rows_of(folder):
    return read_run(folder / "run.mcap", row_dtype(7))[1]


def test_two_runs_are_equal_to_the_bit(runs):
    first, second = (rows_of(folder) for folder in runs)
    for name in ("measurement", "target", "output", "sent"):
        assert first[name].tobytes() == second[name].tobytes()
    truths = [np.load(folder / "truth.npy")[:4000] for folder in runs]  # how long it idles afterwards is the clock's
    assert truths[0].tobytes() == truths[1].tobytes()


def test_the_log_replays_to_the_same_torques(runs):
    again = torques_again(runs[0] / "run.mcap")
    assert again.ticks > 4000
    assert again.same == again.ticks


def test_the_command_line_says_so(runs, capsys):
    assert main(["replay", str(runs[0] / "run.mcap"), "--torques"]) == 0
    assert "are the same, bit by bit" in capsys.readouterr().out


def test_the_log_is_one_that_replay_and_identify_read(runs):
    log = read_log(runs[0] / "run.mcap")
    assert log.q.shape[1] == 7
    assert log.torque is not None
    assert np.diff(log.time).min() > 0.0


def test_the_bottle_in_the_way_is_pressed_gently_until_it_is_taken_away(runs):
    truth = np.load(runs[0] / "truth.npy")
    there = truth["time"] < GOES_S
    assert truth["arm_n"][there].max() > 1.0  # the wrist did meet it
    assert truth["arm_n"][(truth["time"] > GOES_S - 0.5) & there].mean() < 20.0


def test_no_step_of_a_torque_is_beyond_nine_tenths_of_the_robots_rate(runs):
    sent = rows_of(runs[0])["sent"]
    assert np.abs(np.diff(sent, axis=0)).max() <= 0.9 + 1e-9


def test_nothing_is_left_in_shared_memory(runs):
    assert not [name for name in os.listdir("/dev/shm") if name.startswith(f"contactsafe-run-{os.getpid()}")]


@pytest.fixture(scope="module")
def pegs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pegs")
    words = [*RUN, "--task", "insertion", "--seconds", "40", "--rounds", "1", "--out", str(folder)]
    assert main(words) == 0
    return folder / "safe"


def test_a_peg_goes_in_by_the_joints_torques_alone(pegs):
    truth = np.load(pegs / "truth.npy")
    assert truth["position"][:, 2].min() < 0.05 - 0.025
