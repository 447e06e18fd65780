"""`contactsafe run`: what cannot be is refused in one line before anything is started."""

import numpy as np
import pytest

from contactsafe.cli import main
from contactsafe.cli.real_robot import checklist
from contactsafe.cli.robot import Options, StatusLine, load_of, said_of
from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware import states
from contactsafe.hardware.messages import reading_dtype
from contactsafe.hardware.status import status_dtype
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
    (["--simulated", "--dry-run"], "dry_run and recover are for real robots"),
    (["--robot", "172.16.0.2", "--lockstep"], "lockstep is for simulated robots"),
    (["--simulated", "--task", "insertion", "nowhere"], "no bundle at nowhere"),
    (["--simulated", "--camera-calibration", "nowhere.json"], "nowhere.json cannot be read: No such file"),
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
    said = capsys.readouterr().err.strip().splitlines()
    said = [line for line in said if "compiling" not in line]
    assert len(said) == 1
    assert "no Franka answers at 127.0.0.9 (" in said[0]
    assert "check the address, the cable, and FCI in Desk" in said[0]


def test_the_robot_is_told_what_the_tool_weighs_beyond_its_hand():
    mass, centre, inertia = load_of(robots.fr3(WIPER))
    assert mass == pytest.approx(0.1)
    np.testing.assert_allclose(centre, [0.0, 0.0, 0.105], atol=1e-9)  # the felt block's middle
    half = np.array(WIPER.tip.half_size)
    alone = (
        mass / 3.0 * np.diag([half[1] ** 2 + half[2] ** 2, half[0] ** 2 + half[2] ** 2, half[0] ** 2 + half[1] ** 2])
    )
    np.testing.assert_allclose(np.linalg.eigvalsh(inertia), np.sort(np.diag(alone)), rtol=1e-6)
    assert load_of(robots.fr3(HAND)) is None


def test_the_load_is_told_in_the_flanges_frame_which_the_hand_is_turned_in():
    """The block's long edge lies along the hand's x, 45 degrees from the flange's."""
    _, _, inertia = load_of(robots.fr3(WIPER))
    assert inertia[0, 0] == pytest.approx(inertia[1, 1])
    assert abs(inertia[0, 1]) > 0.1 * inertia[0, 0]


def test_a_log_says_all_that_its_torques_follow_from(tmp_path):
    asked = Options(simulated=True, calibration=tmp_path / "mine.json")
    said = said_of(asked, "safe:tank_j=2")
    assert said == {
        "robot": "fr3", "task": "wiping", "controller": "safe:tank_j=2", "calibration": str(tmp_path / "mine.json"),
    }  # fmt: skip
    assert "calibration" not in said_of(Options(simulated=True), "safe")


def test_the_status_line_names_state_reason_contact_and_losses(capsys):
    status = np.zeros(1, status_dtype)
    status["tick"], status["state"], status["reason"] = 12_300, states.HELD, states.TARGET_OLD
    status["contact_link"], status["contact_n"], status["contact_nm"], status["lost"] = 5, 21.4, 7.2, 3
    status["busy"][0, 40] = 10
    line = StatusLine()
    line(status[0])
    line(status[0])  # at once: nothing is said twice
    (said,) = capsys.readouterr().err.strip().splitlines()
    for word in ("12.3 s", "held (targets too old)", "link 5 21 N, 7 N m", "busy 40 µs", "lost 3"):
        assert word in said


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
    assert "camera" not in text


def test_the_checklist_was_silent_where_no_camera_was_calibrated():
    task = pytest.importorskip("contactsafe.tasks.wiping.robot").WipingRobot()
    arm = robots.fr3(task.tool)
    assert "nothing was calibrated" in checklist(Options(robot="a"), arm, task.work(), reading_at(arm, arm.home))


def test_the_checklist_says_where_the_calibrated_camera_stands(tmp_path):
    calibration = pytest.importorskip("contactsafe.vision.camera_calibration").CameraCalibration
    from contactsafe.vision.lens import Lens

    down, lying = np.diag([1.0, -1.0, -1.0, 1.0]), np.eye(4)
    down[:3, 3], lying[:3, 3] = [0.5, 0.1, 0.9], [0.5, 0.0, 0.02]
    known = calibration(Lens(1280, 720, 639.0, 639.0, 640.0, 360.0), down, lying, "42", "touch", {"residual_mm": 0.4})
    known.save(tmp_path / "camera.json")
    task = InsertionRobot()
    arm = robots.fr3(task.tool)
    asked = Options(robot="172.16.0.2", camera_calibration=tmp_path / "camera.json")
    text = checklist(asked, arm, task.work(), reading_at(arm, arm.home))
    for word in (
        "42, 1280 × 720",
        "residual 0.40 mm",
        "at 0.500, 0.100, 0.900 m",
        "its middle at 0.500, 0.000, 0.020 m",
    ):
        assert word in text
    with pytest.raises(InvalidInputError, match="insertion looks with no camera"):
        task.work(camera_calibration=known)


def test_an_arm_at_its_limit_or_on_the_move_is_refused():
    task = InsertionRobot()
    arm = robots.fr3(task.tool)
    q = arm.home.copy()
    q[3] = arm.q_min[3] + 0.01
    with pytest.raises(InvalidInputError, match=r"joint 4 is 0\.01 rad"):
        checklist(Options(robot="a"), arm, task.work(), reading_at(arm, q))
    with pytest.raises(InvalidInputError, match="bring it to rest"):
        checklist(Options(robot="a"), arm, task.work(), reading_at(arm, arm.home, 0.3))
