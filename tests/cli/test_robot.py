"""`contactsafe run`: what cannot be is refused in one line before anything is started."""

import numpy as np
import pytest

from contactsafe.cli import main
from contactsafe.cli.real_robot import checklist
from contactsafe.cli.robot import Options, load_of
from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware.messages import reading_dtype
from contactsafe.robot import robots
from contactsafe.robot.franka import HAND, WIPER
from contactsafe.tasks.insertion.robot import InsertionRobot


@pytest.mark.parametrize(("words", "told"), [
    ([], "give --robot ADDRESS for a Franka, or --simulated"),
    (["--simulated", "--robot", "172.16.0.2"], "give --robot ADDRESS for a Franka, or --simulated"),
    (["--simulated", "--seconds", "0"], "give 1 to 86400"),
    (["--simulated", "--speed", "3"], "give 0.05 to 1"),
    (["--simulated", "--rounds", "0"], "give 1 to 60"),
    (["--simulated", "--priority", "200"], "give 1 to 99"),
    (["--robot", "172.16.0.2", "--lockstep"], "lockstep is for simulated robots"),
    (["--simulated", "--task", "insertion", "nowhere"], "no bundle at nowhere"),
])  # fmt: skip
def test_what_cannot_be_is_refused_in_one_line(words, told, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["run", *words]) == 1
    said = capsys.readouterr().err
    assert told in said
    assert len(said.strip().splitlines()) == 1


def test_a_robot_that_is_not_there_is_told_in_one_line(capsys, tmp_path):
    pytest.importorskip("pylibfranka")
    assert main(["run", "--robot", "127.0.0.9", "--dry-run", "--out", str(tmp_path / "out")]) == 1
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_the_robot_is_told_what_the_tool_weighs_beyond_its_hand():
    mass, centre, _ = load_of(robots.fr3(WIPER))
    assert mass == pytest.approx(0.1)
    assert centre[2] == pytest.approx(0.105, abs=0.01)
    assert load_of(robots.fr3(HAND)) is None


def reading_at(arm, q, qd=0.0):
    reading = np.zeros(1, reading_dtype(7))[0]
    reading["q"], reading["qd"], reading["mode"] = q, qd, 1
    return reading


def test_the_checklist_names_robot_tool_way_speed_and_stop():
    task = InsertionRobot()
    arm = robots.fr3(task.tool)
    text = checklist(Options(robot="172.16.0.2", speed=0.2), arm, task.work(), reading_at(arm, arm.home))
    for word in ("172.16.0.2, idle", "franka hand with peg", "first move", "speed        0.2", "emergency stop"):
        assert word in text


def test_an_arm_at_its_limit_or_on_the_move_is_refused():
    task = InsertionRobot()
    arm = robots.fr3(task.tool)
    q = arm.home.copy()
    q[3] = arm.q_min[3] + 0.01
    with pytest.raises(InvalidInputError, match=r"joint 4 is 0\.01 rad"):
        checklist(Options(robot="a"), arm, task.work(), reading_at(arm, q))
    with pytest.raises(InvalidInputError, match="bring it to rest"):
        checklist(Options(robot="a"), arm, task.work(), reading_at(arm, arm.home, 0.3))
