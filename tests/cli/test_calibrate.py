"""`contactsafe calibrate`: from pictures and touched corners, or a target in the hand, to the file that `run` takes."""

import json
import types

import numpy as np
import pytest
from tests.cli.mistakes import mistake

from contactsafe.cli import calibration_sources, main
from contactsafe.cli.calibrate import Options
from contactsafe.core.rotation import quat_to_matrix
from contactsafe.robot import robots

pytest.importorskip("cv2")

from tests.vision.rendered import D455, TARGET, apart, looking, picture, turn

from contactsafe.vision.camera_calibration import CameraCalibration
from contactsafe.vision.picture_file import read_picture, write_picture
from contactsafe.vision.rigid import inverse, moved, pose_of

LYING = pose_of(turn([0.002, -0.003, 1.6]), [0.51, 0.02, 0.012])
STAND = looking((0.4, 0.1, 0.55), roll=0.2)
CAMERA = LYING @ STAND
LENS = ["--intrinsics", "639", "638", "642", "362", "--distortion", "-0.056", "0.065", "0.0004", "-0.0003", "0"]


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    for k in range(3):
        write_picture(folder / f"{k}.png", picture(STAND, k))
    return [str(folder / f"{k}.png") for k in range(3)]


def touched(path, letters="ABCD", **changes):
    places = {letter: moved(LYING, TARGET.named[letter]).tolist() for letter in letters}
    path.write_text(json.dumps(places | changes))
    return str(path)


def near(found, planted, millimetres, degrees):
    return np.all(np.array(apart(found, planted)) < [millimetres, degrees])


def test_touched_corners_and_pictures_become_a_file(pictures, tmp_path, capsys):
    words = ["calibrate", "touch", "--touched", touched(tmp_path / "t.json"), "--pictures", *pictures, *LENS]
    assert main([*words, "--save", str(tmp_path / "camera.json")]) == 0
    said = capsys.readouterr().out
    for word in (
        "3 with",
        "reprojection error 0.",
        "residual 0.00 mm",
        "its middle at 0.510, 0.020, 0.012 m",
        "tilted by",
    ):
        assert word in said
    found = CameraCalibration.load(tmp_path / "camera.json")
    assert near(found.pose_base_camera, CAMERA, 2.0, 0.3)
    assert near(found.pose_base_target, LYING, 0.01, 0.01)
    assert found.lens == D455
    assert main([*words, "--save", str(tmp_path / "camera.json"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["method"] == "touch"


def test_a_corner_may_be_given_by_joint_positions(tmp_path):
    arm, q = robots.fr3("hand"), np.array([0.1, 0.2, -0.3, -2.0, 0.1, 1.9, 0.5])
    (tmp_path / "t.json").write_text(json.dumps({"A": q.tolist(), "B": [0.1, 0.2, 0.3]}))
    found = calibration_sources.touched_of(Options("touch", touched=tmp_path / "t.json"))
    np.testing.assert_allclose(found["A"], arm.tool_pose(q).position)
    assert found["B"].tolist() == [0.1, 0.2, 0.3]
    longer = calibration_sources.touched_of(Options("touch", touched=tmp_path / "t.json", tip=(0.0, 0.0, 0.1134)))
    assert np.linalg.norm(longer["A"] - found["A"]) == pytest.approx(0.01)


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """Show the target in the hand to the camera from eight sides; return the folder and where the camera is."""
    folder, arm, rng = tmp_path_factory.mktemp("hand"), robots.fr3("flange"), np.random.default_rng(2)

    def hand(q):
        pose = arm.tool_pose(q)
        return pose_of(quat_to_matrix(pose.quat), pose.position)

    camera = looking((1.1, 0.1, 0.6), at=hand(arm.home)[:3, 3])
    facing = camera @ pose_of(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 0.55])
    held, joints = inverse(hand(arm.home)) @ facing, {}
    for k in range(8):
        q = arm.home + rng.uniform(-1.0, 1.0, 7) * [0.1, 0.1, 0.1, 0.1, 0.5, 0.4, 0.6]
        write_picture(folder / f"{k}.png", picture(inverse(hand(q) @ held) @ camera, k))
        joints[f"{k}.png"] = q.tolist()
    (folder / "joints.json").write_text(json.dumps(joints))
    return folder, camera


def test_a_target_in_the_hand_tells_where_the_camera_is(shown, pictures, tmp_path, capsys):
    folder, camera = shown
    words = ["calibrate", "hand-eye", "--poses", str(folder), "--pictures", *pictures, *LENS]
    assert main([*words, "--save", str(tmp_path / "camera.json")]) == 0
    found = CameraCalibration.load(tmp_path / "camera.json")
    assert near(found.pose_base_camera, camera, 5.0, 0.5)
    assert near(inverse(found.pose_base_target) @ found.pose_base_camera, STAND, 2.0, 0.3)
    assert found.errors["residual_mm"] < 3.0
    assert found.errors["residual_deg"] < 0.5
    assert "by hand-eye" in capsys.readouterr().out


def test_with_robot_and_camera_a_person_is_led_through(shown, tmp_path, monkeypatch, capsys):
    arm, places = robots.fr3("hand"), iter("ABCD")
    number = iter(range(1000))
    camera = types.SimpleNamespace(
        intrinsics=types.SimpleNamespace(
            width=1280, height=720, fx=D455.fx, fy=D455.fy, ppx=D455.cx, ppy=D455.cy, coeffs=list(D455.distortion)
        ),
        serial="77", open=lambda: None, close=lambda: None,
        newest=lambda wait_ms=0: (picture(STAND, 1), next(number), 0.0),
    )  # fmt: skip
    monkeypatch.setattr(calibration_sources, "ColourCamera", lambda serial: camera)
    monkeypatch.setattr(calibration_sources, "read_joints", lambda address, n: np.full(n, ord(next(places))))
    corner = lambda q: moved(LYING, TARGET.named[chr(int(q[0]))])  # noqa: E731
    pose = types.SimpleNamespace
    fake = pose(n=7, tool=arm.tool, tool_pose=lambda q: pose(position=corner(q)))
    monkeypatch.setattr(calibration_sources, "_arm", lambda asked: fake)
    monkeypatch.setattr("builtins.input", lambda: "")
    words = ["calibrate", "touch", "--robot", "172.16.0.2", "--corners", "ABCD", "--count", "2"]
    assert main([*words, "--save", str(tmp_path / "camera.json")]) == 0
    asked = capsys.readouterr().err
    assert asked.index("Lay the target") < asked.index("corner A") < asked.index("corner D")
    found = CameraCalibration.load(tmp_path / "camera.json")
    assert (found.serial, found.errors["pictures"]) == ("77", 2)
    assert near(found.pose_base_camera, CAMERA, 3.0, 0.4)


def test_the_target_is_printed_as_asked(tmp_path, capsys):
    assert main(["calibrate", "print", "--save", str(tmp_path / "t.pdf"), "--square-mm", "52"]) == 0
    assert "364 × 260 mm on A3" in capsys.readouterr().out
    assert main(["calibrate", "print", "--save", str(tmp_path / "t.png"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["size_mm"] == [252.0, 180.0]
    assert {path.name for path in tmp_path.iterdir()} == {"t.pdf", "t.png"}


@pytest.mark.parametrize(("words", "told"), [
    (["touch"], "give --robot ADDRESS to read the joints now, or --touched FILE"),
    (["touch", "--touched", "t.json", "--robot", "a"], "give --robot ADDRESS"),
    (["touch", "--touched", "t.json", "--corners", "AB"], "three or four of the letters"),
    (["touch", "--touched", "t.json", "--count", "0"], "count = 0"),
    (["touch", "--touched", "t.json", *LENS[:5]], "intrinsics are for --pictures"),
    (["hand-eye"], "give --poses FOLDER"),
    (["print", "--save", "nowhere/t.pdf"], "is no file that can be written"),
    (["print", "--save", "t.doc"], "is no .pdf or .png"),
    (["print", "--square-mm", "1"], "give 5 to 500 mm"),
    (["touch", "--touched", "t.json", "--pictures", "none.png", *LENS], "none.png cannot be read: No such file"),
    (["touch", "--touched", "t.json", "--pictures", "bad.png", *LENS], "bad.png is no picture"),
    (["touch", "--touched", "t.json", "--pictures", "white.png", *LENS], "no picture shows enough of the target"),
    (["hand-eye", "--poses", ".", "--pictures", "white.png", *LENS], "joints.json cannot be read"),
])  # fmt: skip
def test_mistakes_are_told_in_one_line_and_nothing_is_written(words, told, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_picture(tmp_path / "white.png", np.full((720, 1280, 3), 255, np.uint8))
    (tmp_path / "bad.png").write_bytes(b"no picture")
    touched(tmp_path / "t.json")
    before = sorted(tmp_path.iterdir())
    assert told in mistake(capsys, "calibrate", *words)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(("text", "told"), [
    ("", "is no JSON object"),
    ("[1]", "is no JSON object"),
    ('{"A": 1}', "give x, y, z, m, or 7 joint positions"),
    ('{"A": [1, 2, "x"]}', "give numbers"),
    ('{"A": [1, 2, 3]}', "give three or more of A, B, C, D"),
    ('{"A": [0, 0, 0, 0, 0, 0, NaN]}', "finite"),
])  # fmt: skip
def test_damaged_corners_are_told_in_one_line(text, told, pictures, tmp_path, capsys):
    (tmp_path / "t.json").write_text(text)
    words = ["touch", "--touched", str(tmp_path / "t.json"), "--pictures", *pictures[:1], *LENS]
    assert told in mistake(capsys, "calibrate", *words, "--save", str(tmp_path / "camera.json"))
    assert not (tmp_path / "camera.json").exists()


def test_hand_pictures_without_target_are_named_and_too_few_refused(shown, pictures, tmp_path, capsys):
    folder, _ = shown
    joints = dict(list(json.loads((folder / "joints.json").read_text()).items())[:2])
    for name in joints:
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    write_picture(tmp_path / "empty.png", np.full((720, 1280, 3), 255, np.uint8))
    (tmp_path / "joints.json").write_text(json.dumps(joints | {"empty.png": [0.0] * 7}))
    words = [
        "hand-eye",
        "--poses",
        str(tmp_path),
        "--pictures",
        *pictures[:1],
        *LENS,
        "--save",
        str(tmp_path / "c.json"),
    ]
    assert main(["calibrate", *words]) == 1
    said = capsys.readouterr().err
    assert "not seen well enough: empty.png" in said
    assert f"2 pictures in {tmp_path} show the target well; give three or more" in said
    assert not (tmp_path / "c.json").exists()


def test_nobody_at_the_terminal_is_told(monkeypatch):
    monkeypatch.setattr("builtins.input", lambda: (_ for _ in ()).throw(EOFError))
    with pytest.raises(ValueError, match="nobody answers"):
        calibration_sources.ask("?")


def test_pictures_come_back_pixel_for_pixel(tmp_path):
    image = np.random.default_rng(0).integers(0, 256, (30, 40, 3), dtype=np.uint8)
    write_picture(tmp_path / "a.png", image)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png"), image)
