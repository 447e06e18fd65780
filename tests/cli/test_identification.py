"""`identify` writes what the other commands take, or nothing; `record` writes a motion."""

import json

import numpy as np
import pytest
from tests.logs.plants import logged

from contactsafe import robots
from contactsafe.cli import experiments, main
from contactsafe.experiments import registry
from contactsafe.logs.excitation import excitation
from contactsafe.robot.calibration import Calibration

BIAS = np.array([0.6, -4.0, 0.5, -3.0, 0.3, 0.3, -0.2])


@pytest.fixture(scope="module")
def log():
    arm = robots.panda("hand")
    return logged(arm, excitation(arm, 6.0, 1000.0), torque_bias=BIAS)


@pytest.fixture
def file(log, tmp_path):
    np.savez(tmp_path / "log.npz", t=log.time, q=log.q, qd=log.qd, tau_J=log.torque)
    return tmp_path / "log.npz"


def test_it_writes_a_calibration_and_says_what_it_does(file, tmp_path, capsys):
    assert main(["identify", str(file), "--save", str(tmp_path / "robot.json"), "--out", str(tmp_path / "page")]) == 0
    printed = capsys.readouterr()
    assert printed.out.rstrip().splitlines()[-1].startswith("identified on the first half, the residual of the second")
    assert "What was identified: torque sensors" in printed.out
    assert str(tmp_path / "robot.json") in printed.err
    np.testing.assert_allclose(Calibration.load(tmp_path / "robot.json").sensor.bias, BIAS, rtol=0.05, atol=0.005)
    page = (tmp_path / "page" / "report.html").read_text(encoding="utf-8")
    assert page.count('class="plot"') == 7


def test_json_is_nothing_but_json(file, tmp_path, capsys):
    assert main(["identify", str(file), "--save", str(tmp_path / "robot.json"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["tables"]["check"][-1]["joint"] == "all"
    assert found["tables"]["check"][-1]["smaller by (%)"] > 80.0


def test_the_file_is_named_after_the_log(file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["identify", str(file)]) == 0
    assert (tmp_path / "log.calibration.json").exists()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--robot", "fr4"], "is neither panda, fr3 nor a file"),
        (["--save", "nowhere/robot.json"], "is no file that can be written"),
        (["--topic", "/a"], "is for an MCAP"),
        (["--columns", "torque=tau"], "has no 'tau' for torque"),
    ],
)
def test_mistakes_are_one_line_and_nothing_is_written(file, tmp_path, monkeypatch, capsys, words, text):
    monkeypatch.chdir(tmp_path)
    assert main(["identify", str(file), *words]) == 1
    error = capsys.readouterr().err.strip()
    assert text in error
    assert "\n" not in error
    assert not list(tmp_path.glob("*.json"))


def test_a_log_that_shows_nothing_writes_nothing(log, tmp_path, capsys):
    np.savez(tmp_path / "log.npz", t=log.time, q=0.0 * log.q, qd=0.0 * log.qd, tau_J=log.torque)
    assert main(["identify", str(tmp_path / "log.npz"), "--save", str(tmp_path / "robot.json")]) == 1
    assert "is of an arm at rest" in capsys.readouterr().err
    assert not (tmp_path / "robot.json").exists()


def test_replay_takes_it_and_the_residual_lies_about_nothing(file, tmp_path, capsys):
    assert main(["identify", str(file), "--save", str(tmp_path / "robot.json")]) == 0
    middles = []
    for words in ([], ["--calibration", str(tmp_path / "robot.json")]):
        capsys.readouterr()
        assert main(["replay", str(file), "--json", *words]) == 0
        found = json.loads(capsys.readouterr().out)
        middles.append(max(abs(row["middle of it (%)"]) for row in found["tables"]["signals"]))
        if not words:
            assert "run contactsafe identify" in found["question"]
    assert middles[0] > 50.0
    assert middles[1] < 10.0


COMMANDS = (
    "evaluate --episodes 1 --scripted random",
    "experiment detection",
    "experiment disturbance",
    "demo",
    "replay log.npz",
    "train ppo --task insertion --num-envs 8 --out run",
)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_another_robots_calibration(file, tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    noise = np.full(7, 0.1)
    Calibration("fr3", "franka hand", noise, noise, noise).save("robot.json")
    assert main([*command.split(), "--calibration", "robot.json"]) == 1
    assert "the calibration is of 'fr3' with 7 joints, the arm is 'panda' with 7" in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_what_is_no_calibration(file, tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.json").write_text("{}", encoding="utf-8")
    assert main([*command.split(), "--calibration", "robot.json"]) == 1
    assert "robot.json is no calibration; give what `contactsafe identify` wrote" in capsys.readouterr().err


def test_a_calibration_is_read_once(tmp_path, monkeypatch):
    """It was read for the task and again for the arm."""
    noise, read = np.full(7, 0.1), []
    known = Calibration("panda", "franka hand", noise, noise, noise)
    monkeypatch.setattr(Calibration, "load", lambda path: read.append(path) or known)
    asked = experiments.Options("disturbance", calibration=tmp_path / "robot.json")
    config = experiments._config(asked, registry.by_name("disturbance"))
    assert read == [tmp_path / "robot.json"]
    assert config.arm.calibrated
    assert config.arm_words == ("--calibration", str(tmp_path / "robot.json"))


def test_record_says_for_which_robot_its_log_is_identified(tmp_path, capsys):
    words = ["--robot", "fr3", "--tool", "flange"]
    assert main(["record", *words, "--seconds", "6", "--rate", "50", "--out", str(tmp_path / "motion.csv")]) == 0
    assert capsys.readouterr().out.endswith("Then: contactsafe identify LOG --robot fr3 --tool flange\n")


def test_record_writes_a_motion_that_a_robot_can_follow(tmp_path, capsys):
    path = tmp_path / "motion.csv"
    assert main(["record", "--seconds", "6", "--rate", "100", "--floor", "0", "--out", str(path)]) == 0
    assert "contactsafe identify LOG" in capsys.readouterr().out
    header, *rows = path.read_text(encoding="utf-8").splitlines()
    assert header.startswith("time,q_0,")
    assert header.endswith("qd_6")
    assert len(rows) == 601
    values = np.loadtxt(path, delimiter=",", skiprows=1)
    np.testing.assert_allclose(values[[0, -1], 1:8], np.tile(robots.panda().home, (2, 1)), atol=1e-8)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--seconds", "1"], "seconds = 1; give 5 to 600"),
        (["--seed", "-1"], "seed = -1; give 0 or more"),
        (["--out", "nowhere/motion.csv"], "is no file that can be written"),
    ],
)
def test_record_refuses_what_cannot_be(tmp_path, monkeypatch, capsys, words, text):
    monkeypatch.chdir(tmp_path)
    assert main(["record", *words]) == 1
    assert text in capsys.readouterr().err
