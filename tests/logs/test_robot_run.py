"""The log of a run: computed again it gives the same torques, and it is a log like any other."""

import numpy as np
import pytest
from tests.hardware.bench import Bench

from contactsafe.cli import main
from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.messages import row_dtype
from contactsafe.hardware.recorder import Recorder
from contactsafe.hardware.run_log import read_run
from contactsafe.logs.reading import read_log
from contactsafe.logs.robot_run import TorquesAgain, run_arrays, torques_again

RUN = {"robot": "fr3", "task": "wiping", "controller": "safe"}


def written(path, rows, run=RUN):
    """Write rows as a run's log."""
    exchange = Exchange.create(7)
    try:
        exchange.ticks[: len(rows)] = rows
        exchange.status["rows"] = len(rows)
        recorder = Recorder(exchange, path, run)
        recorder.drain()
        recorder.finish()
    finally:
        exchange.unlink()
    return path


def moved_and_pushed(one, tick):
    if tick == 60:
        one.pose = one.pose._replace(position=np.add(one.pose.position, [0.03, 0.02, 0.0]))
    one.robot.push = np.array([0.0, 5.0, 0.0, 4.0, 0.0, 0.0, 0.0]) if 200 <= tick < 400 else np.zeros(7)


@pytest.fixture(scope="module")
def rows():
    """Give the ticks of a run on a robot of this process, moved and pushed."""
    one = Bench(moved_and_pushed)
    try:
        one.run(500)
        return one.exchange.ticks[: int(one.status["rows"])].copy()
    finally:
        one.close()


def test_every_torque_is_the_same_bit_by_bit(rows, tmp_path):
    again = torques_again(written(tmp_path / "run.mcap", rows))
    assert again.ticks == len(rows) - 1 > 500
    assert again == TorquesAgain(again.ticks, again.ticks, 0.0, 0)
    assert again.verdict == f"all {again.ticks} torques are the same, bit by bit"


def test_a_torque_that_was_not_the_controllers_is_found_with_its_tick(rows, tmp_path, capsys):
    changed = rows.copy()
    changed["output"]["torque"][100, 3] = np.nextafter(changed["output"]["torque"][100, 3], np.inf)
    again = torques_again(written(tmp_path / "run.mcap", changed))
    assert (again.ticks - again.same, again.first) == (1, 100)
    assert 0.0 < again.largest_nm < 1e-12
    assert main(["replay", str(tmp_path / "run.mcap"), "--torques"]) == 1
    assert "1 of" in capsys.readouterr().err


def test_another_controller_gives_others(rows, tmp_path):
    again = torques_again(written(tmp_path / "run.mcap", rows, RUN | {"controller": "vices"}))
    assert again.same < again.ticks
    assert "differ" in again.verdict


@pytest.mark.parametrize(("run", "told"), [
    ({"robot": "ur5e"}, "robot 'ur5e'; known are fr3, panda"),
    ({"task": "dancing"}, "dancing"),
    ({"controller": "gentle"}, "gentle"),
])  # fmt: skip
def test_a_run_of_what_is_unknown_here_is_refused_in_one_line(rows, tmp_path, run, told):
    with pytest.raises(InvalidInputError, match=told) as caught:
        torques_again(written(tmp_path / "run.mcap", rows[:20], RUN | run))
    assert "\n" not in str(caught.value)


def test_a_log_without_its_beginning_is_refused(rows, tmp_path):
    with pytest.raises(InvalidInputError, match="does not begin with the run's first tick"):
        torques_again(written(tmp_path / "run.mcap", rows[10:]))


@pytest.mark.parametrize(("name", "told"), [
    ("none.mcap", "none.mcap does not exist; give the run.mcap"),
    ("other.mcap", "is no log of `contactsafe run`"),
])  # fmt: skip
def test_what_is_no_run_cannot_be_computed_again(tmp_path, capsys, name, told):
    (tmp_path / "other.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    assert main(["replay", str(tmp_path / name), "--torques"]) == 1
    assert told in capsys.readouterr().err


def test_it_is_read_as_a_log_with_the_robots_own_time_and_torque(rows, tmp_path):
    log = read_log(written(tmp_path / "run.mcap", rows))
    seen = rows["reading"][1:]
    np.testing.assert_array_equal(log.q, seen["q"])
    np.testing.assert_array_equal(log.qd, seen["qd"])
    np.testing.assert_array_equal(log.torque, seen["torque"])
    np.testing.assert_allclose(np.diff(log.time), 1e-3, atol=1e-9)


def test_a_state_that_came_twice_is_left_out(rows, tmp_path):
    twice = rows[:80].copy()
    twice["reading"][41] = twice["reading"][40]
    arrays = run_arrays(written(tmp_path / "run.mcap", twice))
    assert len(arrays["time"]) == 78
    assert (np.diff(arrays["time"]) > 0.0).all()


def test_what_is_no_run_is_left_to_other_readers(tmp_path):
    (tmp_path / "other.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    assert run_arrays(tmp_path / "other.mcap") is None


def test_replay_finds_the_push_in_it(rows, tmp_path, capsys):
    """The contact estimator, played a run's log like any other."""
    words = ["replay", str(written(tmp_path / "run.mcap", rows)), "--robot", "fr3", "--tool", "wiper"]
    assert main(words) == 0
    assert "0 contacts" not in capsys.readouterr().out.splitlines()[-1]


def test_the_rows_are_those_of_the_run(rows, tmp_path):
    _, read = read_run(written(tmp_path / "run.mcap", rows), row_dtype(7))
    assert read.tobytes() == rows.tobytes()
