"""The file of a camera: what was written is read, what is damaged is refused in one line, nothing is half written."""

import dataclasses
import json

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError, OutputError

pytest.importorskip("cv2")

from tests.vision.rendered import D455, looking, turn

from contactsafe.vision.camera_calibration import CameraCalibration
from contactsafe.vision.rigid import pose_of

LYING = pose_of(turn([0.003, -0.002, 1.6]), [0.51, 0.02, 0.012])


def found(**changes):
    known = {"serial": "123", "method": "touch", "errors": {"reprojection_px": 0.2}, "date": "2026-01-02T03:04:05"}
    return CameraCalibration(D455, LYING @ looking((-0.4, 0.5, 0.7), roll=0.2), LYING, **{**known, **changes})


def test_what_was_written_is_read(tmp_path):
    found().save(tmp_path / "camera.json")
    back = CameraCalibration.load(tmp_path / "camera.json")
    for name in ("pose_base_camera", "pose_base_target"):
        np.testing.assert_allclose(getattr(back, name), getattr(found(), name), atol=1e-12)
    for name in ("lens", "serial", "method", "errors", "date"):
        assert getattr(back, name) == getattr(found(), name)


@pytest.mark.parametrize("damage", [
    lambda known: known.pop("lens"),
    lambda known: known["lens"].pop("fx"),
    lambda known: known["lens"].update(fx=-1.0),
    lambda known: known["lens"].update(distortion=[0.0]),
    lambda known: known.update(lens=7),
    lambda known: known["pose_base_camera"].update(quat=[1.0, 1.0, 0.0, 0.0]),
    lambda known: known["pose_base_camera"].update(position_m=[0.0, 0.0]),
    lambda known: known["pose_base_camera"].update(position_m=[0.5, 0.0, 0.0]),
    lambda known: known["pose_base_target"].update(position_m=[0.5, float("nan"), 0.0]),
    lambda known: known.update(errors={"reprojection_px": "many"}),
    lambda known: known.update(errors=[]),
])  # fmt: skip
def test_a_damaged_file_is_refused_in_one_line(tmp_path, damage):
    known = found().as_dict()
    damage(known)
    (tmp_path / "camera.json").write_text(json.dumps(known))
    with pytest.raises(InvalidInputError) as caught:
        CameraCalibration.load(tmp_path / "camera.json")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "null", '{"format": "contactsafe calibration 1"}', "[" * 9000, " " * 10**6]
)
def test_a_file_of_another_kind_is_refused(tmp_path, text):
    (tmp_path / "camera.json").write_text(text)
    with pytest.raises(InvalidInputError, match=r"camera\.json is no camera calibration; give what"):
        CameraCalibration.load(tmp_path / "camera.json")


def test_no_file_and_no_folder_are_told_in_one_line(tmp_path):
    with pytest.raises(InvalidInputError, match="cannot be read: No such file"):
        CameraCalibration.load(tmp_path / "nothing.json")
    with pytest.raises(OutputError, match="cannot write"):
        found().save(tmp_path / "nowhere" / "camera.json")
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "camera.json"
    found().save(path)
    old = path.read_bytes()
    monkeypatch.setattr("os.replace", lambda *names: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(OutputError, match="make room"):
        found(serial="456").save(path)
    assert path.read_bytes() == old
    assert list(tmp_path.iterdir()) == [path]


def test_poses_and_errors_that_cannot_be_are_refused():
    with pytest.raises(InvalidInputError, match="pose_base_target is no pose"):
        dataclasses.replace(found(), pose_base_target=np.diag([1.0, 1.0, -1.0, 1.0]))
    with pytest.raises(InvalidInputError, match=r"-0\.70 m above the target's plane, allowed 0\.1 m"):
        dataclasses.replace(found(), pose_base_target=LYING @ np.diag([1.0, -1.0, -1.0, 1.0]))
    with pytest.raises(InvalidInputError, match="not a finite number"):
        found(errors={"a": np.inf})
