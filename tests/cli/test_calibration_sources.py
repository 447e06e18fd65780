"""What a calibration is made of: a robot that is read and told nothing, a camera, files written as they come."""

import json
import types

import numpy as np
import pytest

from contactsafe.cli import calibration_sources as sources
from contactsafe.cli.calibrate import Options
from contactsafe.core.errors import ContactSafeError, InvalidInputError
from contactsafe.hardware.realsense import CameraError
from contactsafe.robot import robots

pytest.importorskip("cv2")

from contactsafe.vision.charuco import CharucoTarget
from contactsafe.vision.picture_file import read_picture, write_picture

Q = np.array([0.1, -0.7, 0.0, -2.3, 0.1, 1.6, 0.8])
KNOWN = types.SimpleNamespace(width=1280, height=720, fx=640.0, fy=639.0, ppx=641.0, ppy=361.0, coeffs=[0.0] * 5)


class Port:
    """A robot that stands still, or does not."""

    calls: list
    velocity = 0.0

    def __init__(self, address):
        Port.calls = [address]

    def reach(self):
        Port.calls.append("reach")

    def look(self, reading):
        Port.calls.append("look")
        reading["q"], reading["qd"] = Q, self.velocity

    def close(self):
        Port.calls.append("close")


class Device:
    """A camera whose pictures are numbered; a frozen one shows the same for ever."""

    intrinsics, serial = KNOWN, "7"

    def __init__(self, frozen=False, size=(720, 1280, 3)):
        self.frozen, self.size, self.number, self.closed = frozen, size, 0, 0

    def open(self):
        pass

    def close(self):
        self.closed += 1

    def newest(self, wait_ms=0):
        self.number += 0 if self.frozen else wait_ms > 0
        return np.full(self.size, self.number % 256, np.uint8), self.number, 0.0


@pytest.fixture
def device(monkeypatch):
    made = Device()
    monkeypatch.setattr(sources, "ColourCamera", lambda serial: made)
    return made


def test_a_robot_is_read_once_and_told_nothing(monkeypatch):
    monkeypatch.setattr(sources, "FrankaPort", Port)
    np.testing.assert_array_equal(sources.read_joints("172.16.0.2", 7), Q)
    assert Port.calls == ["172.16.0.2", "reach", "look", "close"]


def test_a_robot_that_moves_is_refused_and_let_go_of(monkeypatch):
    monkeypatch.setattr(sources, "FrankaPort", type("Moving", (Port,), {"velocity": 0.3}))
    with pytest.raises(InvalidInputError, match="the arm moves; hold it still"):
        sources.read_joints("a", 7)
    assert Port.calls[-1] == "close"


def test_a_robot_that_cannot_be_reached_is_let_go_of(monkeypatch):
    def fails(self):
        raise InvalidInputError("no route")

    monkeypatch.setattr(sources, "FrankaPort", type("Gone", (Port,), {"reach": fails}))
    with pytest.raises(InvalidInputError, match="no route"):
        sources.read_joints("a", 7)
    assert Port.calls[-1] == "close"


def test_lens_and_serial_are_the_devices_and_every_picture_is_a_new_one(device):
    with sources.Source(Options("touch", count=4)) as source:
        assert (source.lens.fx, source.lens.cy, source.serial) == (640.0, 361.0, "7")
        assert [int(picture[0, 0, 0]) for picture in source.lying()] == [1, 2, 3, 4]
    assert device.closed == 1


def test_a_frozen_camera_is_told(device):
    device.frozen = True
    with sources.Source(Options("touch")) as source, pytest.raises(CameraError, match="shows nothing new"):
        source.take()
    assert device.closed == 1


def test_pictures_from_files_go_by_the_connected_lens_if_they_are_of_its_size(device, tmp_path):
    write_picture(tmp_path / "a.png", np.zeros((720, 1280, 3), np.uint8))
    write_picture(tmp_path / "b.png", np.zeros((480, 640, 3), np.uint8))
    with sources.Source(Options("touch", pictures=(tmp_path / "a.png",))) as source:
        assert source.lens.fx == 640.0
        assert len(source.lying()) == 1
    with pytest.raises(InvalidInputError, match="not of the connected camera's size; say their --intrinsics"):
        sources.Source(Options("touch", pictures=(tmp_path / "b.png",)))
    with pytest.raises(InvalidInputError, match="pictures of 2 sizes"):
        sources.Source(Options("touch", pictures=(tmp_path / "a.png", tmp_path / "b.png")))


def test_with_intrinsics_no_camera_is_opened(monkeypatch, tmp_path):
    def opened(serial):
        raise AssertionError("opened")

    monkeypatch.setattr(sources, "ColourCamera", opened)
    write_picture(tmp_path / "a.png", np.zeros((480, 640, 3), np.uint8))
    asked = Options("touch", pictures=(tmp_path / "a.png",), intrinsics=(500.0, 501.0, 320.0, 240.0), camera="9")
    with sources.Source(asked) as source:
        assert (source.lens.width, source.lens.fy, source.serial) == (640, 501.0, "9")
        with pytest.raises(InvalidInputError, match="taken with a RealSense"):
            source.take()


def test_pictures_in_the_hand_are_kept_with_their_joints_as_they_come(device, monkeypatch, tmp_path):
    """Whoever stops half through has what was taken until then."""
    answers, folder = iter(["", "", "q"]), tmp_path / "hand"
    joints = iter([Q, Q + 0.1])
    monkeypatch.setattr("builtins.input", lambda: next(answers))
    monkeypatch.setattr(sources, "read_joints", lambda address, n: next(joints))
    asked = Options("hand-eye", robot="a", poses=folder)
    with (
        sources.Source(asked) as source,
        pytest.raises(ContactSafeError, match=r"0 pictures in .* show the target well"),
    ):
        sources.hand_eye_of(asked, CharucoTarget(), source)
    kept = json.loads((folder / sources.JOINTS).read_text())
    assert list(kept) == ["01.png", "02.png"]
    np.testing.assert_allclose(kept["02.png"], Q + 0.1)
    assert read_picture(folder / "01.png")[0, 0, 0] == 1
    assert {path.name for path in folder.iterdir()} == {"01.png", "02.png", "joints.json"}


@pytest.mark.parametrize("values", ["x", [1.0], [0.0] * 6, [[0.0]] * 7, {"a": 1}, [None] * 7])
def test_joints_that_are_none_are_refused_in_one_line(values, tmp_path, monkeypatch):
    """The picture is good; its joint positions are not."""
    write_picture(tmp_path / "1.png", np.zeros((720, 1280, 3), np.uint8))
    (tmp_path / sources.JOINTS).write_text(json.dumps({"1.png": values}))
    seen = types.SimpleNamespace(pose_target_camera=np.eye(4))
    monkeypatch.setattr(sources, "find_camera", lambda *known: seen)
    asked = Options("hand-eye", poses=tmp_path)
    with pytest.raises(InvalidInputError) as caught:
        sources.hand_eye_of(asked, CharucoTarget(), types.SimpleNamespace(lens=None))
    assert "\n" not in str(caught.value)


def test_the_tip_is_in_the_tools_frame():
    """Straight below the hand at home, one centimetre longer is one centimetre lower."""
    short, long = (sources._arm(Options("touch", tip=(0.0, 0.0, z))) for z in (0.10, 0.11))
    home = robots.fr3("hand").home
    np.testing.assert_allclose(
        long.tool_pose(home).position - short.tool_pose(home).position, [0.0, 0.0, -0.01], atol=1e-9
    )
    flange = sources._arm(Options("touch", tool="flange", tip=(0.0, 0.0, 0.10)))
    np.testing.assert_allclose(flange.tool_pose(home).position, short.tool_pose(home).position, atol=1e-9)
