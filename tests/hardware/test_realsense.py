"""A camera at sensor level: a device made of software is read by the code that reads a real one."""

import numpy as np
import pytest

from contactsafe.hardware import realsense

pytest.importorskip("pyrealsense2", exc_type=ImportError)  # or without libusb

from contactsafe.hardware.realsense import HEIGHT, WIDTH, CameraError, ColourCamera, SoftwareCamera


@pytest.fixture
def device():
    return SoftwareCamera(639.0, 638.0, 639.5, 359.5, (-0.056, 0.065, 0.0, 0.0, 0.0))


@pytest.fixture
def camera(device):
    made = ColourCamera(sensor=device.sensor, profile=device.profile)
    made.open()
    yield made
    made.close()


def picture(seed):
    return np.random.default_rng(seed).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)


def test_before_the_first_picture_there_is_none(camera):
    found, number, _ = camera.newest()
    assert found is None
    assert number == -1


def test_the_newest_picture_comes_pixel_for_pixel_with_its_number(device, camera):
    for number in (1, 2, 3):
        device.give(picture(number), number, 33.0 * number)
    found, number, age_ms = camera.newest(200)
    assert number == 3
    assert (found == picture(3)).all()
    assert age_ms < 200.0


def test_a_camera_that_freezes_shows_by_the_age_of_its_picture(device, camera, monkeypatch):
    device.give(picture(1), 1, 33.0)
    camera.newest(200)
    now = realsense.time.monotonic()
    monkeypatch.setattr(realsense.time, "monotonic", lambda: now + 1.0)
    found, number, age_ms = camera.newest()
    assert number == 1
    assert found is not None
    assert age_ms > 900.0


def test_the_lens_is_what_the_device_says(device, camera):
    lens = camera.intrinsics
    assert (lens.width, lens.height, lens.fx, lens.fy) == (WIDTH, HEIGHT, 639.0, 638.0)
    assert lens.coeffs[:2] == pytest.approx([-0.056, 0.065])


@pytest.mark.parametrize(("serial", "told"), [(None, "no RealSense camera is connected"), ("42", "camera 42")])
def test_a_camera_that_is_not_there_is_told_in_one_line(serial, told):
    with pytest.raises(CameraError, match=told) as caught:
        ColourCamera(serial).open()
    assert "\n" not in str(caught.value)


def test_a_camera_that_is_gone_is_looked_for_once_a_second(monkeypatch):
    camera, tries = ColourCamera(), []
    monkeypatch.setattr(camera, "open", lambda: tries.append(1))
    now = [100.0]
    monkeypatch.setattr(realsense.time, "monotonic", lambda: now[0])
    assert camera.look_again()
    assert not camera.look_again()
    now[0] += 1.5
    assert camera.look_again()
    assert len(tries) == 2


def test_a_camera_that_is_opened_again_has_no_picture_until_one_comes(device, camera, monkeypatch):
    """The last picture before it was unplugged is not what it sees now, for a moment at each try."""
    device.give(picture(1), 1, 33.0)
    camera.newest(200)
    monkeypatch.setattr(camera, "_find", lambda: (device.sensor, device.profile))
    assert camera.look_again()
    assert camera.newest()[0] is None
    device.give(picture(2), 2, 66.0)
    assert (camera.newest(200)[0] == picture(2)).all()


def test_closing_twice_does_no_harm(camera):
    camera.close()
    camera.close()
    assert camera.newest()[0] is None


def test_the_serial_number_is_that_of_the_device_that_was_found(camera, device, monkeypatch):
    assert camera.serial == ""
    library = realsense.library()
    known = {library.camera_info.serial_number: "4711"}
    sensor = type("Sensor", (), {"get_stream_profiles": lambda self: [device.profile]})()
    made = type("Device", (), {"get_info": lambda self, name: known[name], "query_sensors": lambda self: [sensor]})()
    context = type("Context", (), {"query_devices": lambda self: [made]})
    monkeypatch.setattr(library, "context", context)
    found = ColourCamera()
    assert found._find()[0] is sensor
    assert found.serial == "4711"
    with pytest.raises(CameraError, match="no RealSense camera 42"):
        ColourCamera("42")._find()
