"""A RealSense before the board: its pictures as photographs, its silence as age, its absence in one line."""

import math
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("cv2")
pytest.importorskip("pyrealsense2", exc_type=ImportError)  # or without libusb

from contactsafe.hardware.realsense import CameraError
from contactsafe.robot import robots
from contactsafe.tasks.wiping import robot_pictures
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.robot_board import create_shown, map_shown
from contactsafe.tasks.wiping.robot_photographs import PhotographedBoard
from contactsafe.tasks.wiping.robot_pictures import UNDER_WAY_MS, CameraPictures, focal_px


class Source:
    """A camera that the test unplugs and plugs in again."""

    def __init__(self, serial=None):
        self.serial, self.picture, self.number, self.age_ms, self.looked = serial, None, -1, 0.0, 0
        self.intrinsics = SimpleNamespace(
            width=1280, height=720, fx=639.0, fy=639.0, ppx=639.5, ppy=359.5, coeffs=[-0.056, 0.065, 0.0, 0.0, 0.0]
        )

    def open(self):
        pass

    def newest(self, wait_ms=0):
        return self.picture, self.number, self.age_ms

    def look_again(self):
        self.looked += 1

    def close(self):
        self.closed = True


@pytest.fixture
def pictures(monkeypatch):
    monkeypatch.setattr(robot_pictures, "ColourCamera", Source)
    made = CameraPictures("42", Camera())
    made.open()
    return made


def grey(level):
    return np.full((720, 1280, 3), level, np.uint8)


def test_before_the_first_picture_there_is_no_sight(pictures):
    photo, number, age_ms = pictures.latest(0)
    assert photo.shape == (455, 455, 3)
    assert number == -1
    assert age_ms == math.inf


def test_a_picture_becomes_the_photograph_of_its_middle_once(pictures):
    source = pictures._source
    source.picture, source.number = grey(90), 7
    source.picture[340:380, 620:660] = 200
    photo, number, _ = pictures.latest(0)
    assert number == 7
    assert photo[227, 227, 0] == 200
    assert photo[10, 10, 0] == 90
    source.picture = grey(0)  # of the same number: nothing new
    assert pictures.latest(1)[0][227, 227, 0] == 200


def test_a_camera_that_is_gone_is_looked_for_and_its_last_picture_ages(pictures):
    source = pictures._source
    source.picture, source.number = grey(90), 7
    pictures.latest(0)
    source.age_ms = 600.0
    _, number, age_ms = pictures.latest(1)
    assert (number, age_ms) == (7, 600.0 + UNDER_WAY_MS)
    assert source.looked == 1
    source.picture, source.number, source.age_ms = grey(120), 8, 5.0
    photo, number, age_ms = pictures.latest(2)
    assert (number, age_ms) == (8, 5.0 + UNDER_WAY_MS)
    assert photo[227, 227, 0] == 120


def test_the_camera_that_was_asked_for_is_the_one_that_is_opened(pictures):
    assert pictures._source.serial == "42"


def test_a_camera_that_is_not_there_is_told_and_nothing_is_left_to_close():
    made = CameraPictures("no such", Camera())
    with pytest.raises(CameraError, match="no RealSense camera no such"):
        made.open()
    made.close()


def test_a_photograph_is_the_square_that_masks_are_scaled_from():
    assert focal_px(Camera()) == pytest.approx(640.0, rel=1e-2)


def test_the_software_camera_takes_thirty_pictures_a_second_and_each_once(tmp_path):
    create_shown(tmp_path / "board", BoardConfig())
    arm = robots.fr3()
    made = PhotographedBoard(tmp_path / "board", arm, BoardConfig(), Camera(), 3)
    made.open()
    map_shown(tmp_path / "board", BoardConfig())["q"][0] = arm.home
    numbers, photos = [], []
    for tick in range(0, 1000, 17):
        photo, number, age_ms = made.latest(tick)
        numbers.append(number)
        photos.append(photo)
        assert 0.0 <= age_ms < 34.0
    made.close()
    assert len(set(numbers)) == pytest.approx(30, abs=1)
    for before, after, one, other in zip(numbers, numbers[1:], photos, photos[1:], strict=False):
        assert (one is other) == (before == after)
    first = photos[0]
    assert first.std() > 5.0  # board, table and arm, not grey


def test_the_software_camera_can_be_closed_before_it_was_opened(tmp_path):
    PhotographedBoard(tmp_path / "board", robots.fr3(), BoardConfig(), Camera(), 3).close()


def test_by_the_clock_a_process_of_its_own_draws_and_ends_with_the_camera(tmp_path):
    create_shown(tmp_path / "board", BoardConfig())
    arm, shown = robots.fr3(), map_shown(tmp_path / "board", BoardConfig())[0]
    shown["q"] = arm.home
    made = PhotographedBoard(tmp_path / "board", arm, BoardConfig(), Camera(), 3)
    made.open(lockstep=False)
    try:
        first, number, _ = made.latest(0)
        assert (number, first.std() > 5.0) == (0, True)
        shown["tick"] = 99
        until = time.monotonic() + 30.0
        while number != 3 and time.monotonic() < until:
            photo, number, _ = made.latest(40)
        shown["tick"] = 105
        assert made.latest(40)[2] == 6.0  # of the camera's clock: control counts fewer ticks, for it loses states
        assert photo is not first
    finally:
        made.close()
    assert not made._process.is_alive()


def test_while_a_picture_is_drawn_the_last_one_stays_the_newest(tmp_path):
    """Numbers skip where drawing is slow, and what was drawn over was the newest: pictures went back in time."""
    create_shown(tmp_path / "board", BoardConfig())
    shown = map_shown(tmp_path / "board", BoardConfig())[0]
    shown["q"] = robots.fr3().home
    made = PhotographedBoard(tmp_path / "board", robots.fr3(), BoardConfig(), Camera(), 3)
    made.open(lockstep=False)
    try:
        numbers, ages, tick, until = [], [], 0, time.monotonic() + 60.0
        while len(set(numbers)) < 6 and time.monotonic() < until:
            tick += 3  # far faster than pictures are drawn
            shown["tick"] = tick
            numbers.append(made.latest(0)[1])
            ages.append(made.latest(0)[2])
            time.sleep(0.001)
        assert (np.diff(numbers) >= 0).all()
        assert len(set(numbers)) == 6
        assert min(ages) >= 0.0
    finally:
        made.close()
