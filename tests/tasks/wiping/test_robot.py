"""Wiping on a robot: a board whose ink vanishes, seen through a D455's lens by librealsense's own sensor interface."""

import math

import numpy as np
import pytest

from contactsafe.control.codes import FREE, REJECT
from contactsafe.hardware.messages import seen_dtype
from contactsafe.robot import robots
from contactsafe.tasks.wiping.board import BoardConfig, Camera, pad_half
from contactsafe.tasks.wiping.robot_board import WipedBoard, create_shown, map_shown

pytest.importorskip("cv2")
pytest.importorskip("pyrealsense2", exc_type=ImportError)  # or without libusb

from contactsafe.tasks.wiping.robot_photographs import PhotographedBoard
from contactsafe.tasks.wiping.robot_work import WipingWork


@pytest.fixture(scope="module")
def arm():
    return robots.fr3()


@pytest.fixture
def shown(tmp_path):
    create_shown(tmp_path / "board", BoardConfig())
    return tmp_path / "board"


def board_of(shown, arm, rounds=2, first_s=0.0):
    made = WipedBoard(shown, BoardConfig(), pad_half(arm), "strokes", 4, rounds, first_s)
    made.begin(None)
    return made


def wipe_all(board, z=0.01):
    """Move the pad over all of the board, pressed."""
    for x in np.arange(0.3, 0.7, 0.04):
        for y in np.arange(-0.25, 0.26, 0.03):
            board.after_step(0, np.zeros(7), np.array([x, y, z]), np.eye(3), 5.0)


def test_ink_goes_under_a_pressed_pad_alone_and_somebody_draws_once_the_arm_is_away(shown, arm):
    board, known = board_of(shown, arm), map_shown(shown, BoardConfig())[0]
    board.after_step(0, np.zeros(7), np.array([0.5, 0.0, 0.2]), np.eye(3), 0.0)
    drawn = int(known["ink_start"][0])
    assert known["ink"][0] == drawn > 100
    for x in (0.4, 0.5, 0.6):
        board.after_step(8, np.zeros(7), np.array([x, 0.0, 0.012]), np.eye(3), 0.1)  # too lightly
    assert known["ink"][0] == drawn
    wipe_all(board)
    assert known["ink"][0] == 0
    for tick in range(400):
        board.after_step(tick, np.zeros(7), np.array([0.5, 0.0, 0.1]), np.eye(3), 0.0)
    assert known["number"] == 0
    for tick in range(200):
        board.after_step(tick, np.zeros(7), np.array([0.5, 0.0, 0.1]), np.eye(3), 0.0)
    assert known["number"] == 1
    assert known["ink"][1] > 100
    wipe_all(board)
    for tick in range(700):
        board.after_step(tick, np.zeros(7), np.array([0.5, 0.0, 0.1]), np.eye(3), 0.0)
    assert known["number"] == 1  # nobody draws a third one


def test_a_board_that_the_robot_takes_for_clean_is_drawn_on_as_well(shown, arm):
    """Six per cent of its ink were left, in too few pixels to be seen from above, and both waited for six minutes."""
    board, known = board_of(shown, arm), map_shown(shown, BoardConfig())[0]
    high = np.array([0.5, 0.0, 0.1])
    for tick in range(20_000):  # a slow arm is on its way
        board.after_step(tick, np.zeros(7), high, np.eye(3), 0.0)
    assert known["number"] == 0
    board.after_step(1, np.zeros(7), np.array([0.3, -0.25, 0.012]), np.eye(3), 5.0)
    for number, away in ((0, 9_900), (1, 200)):
        for tick in range(away):
            board.after_step(tick, np.zeros(7), high, np.eye(3), 0.0)
        assert known["number"] == number
    assert known["ink"][0] > 0.05 * known["ink_start"][0]


def test_the_first_board_is_drawn_when_it_is_to_be(shown, arm):
    board, known = board_of(shown, arm, first_s=1.0), map_shown(shown, BoardConfig())[0]
    board.after_step(999, np.zeros(7), np.array([0.5, 0.0, 0.1]), np.eye(3), 0.0)
    assert known["number"] == -1
    board.after_step(1000, np.zeros(7), np.array([0.5, 0.0, 0.1]), np.eye(3), 0.0)
    assert known["number"] == 0


def test_what_the_camera_shows_becomes_the_mask_that_training_had(shown, arm):
    """Through lens, sensor interface, undistortion and segmentation: the pixels of ink are those of the board."""
    from contactsafe.tasks.wiping.camera import plane_homography
    from contactsafe.tasks.wiping.whiteboard import INK, Whiteboard

    board, known = board_of(shown, arm), map_shown(shown, BoardConfig())[0]
    board.after_step(0, arm.home, np.array([0.3, 0.0, 0.4]), np.eye(3), 0.0)
    work = WipingWork(PhotographedBoard(shown, arm, BoardConfig(), Camera(), 2))
    work.prepare(arm, True)
    seen = np.zeros(1, seen_dtype(7))[0]
    seen["q"], seen["tick"] = arm.home, 40
    mask = work.look(seen, np.zeros(6), 0)["mask"][..., 0]
    work.close()
    rows, columns = np.nonzero(known["cells"] == INK)
    origin, cell = Whiteboard(BoardConfig()).origin, BoardConfig().cell
    points = np.stack([origin[0] + (rows + 0.5) * cell, origin[1] + (columns + 0.5) * cell, np.ones(len(rows))])
    u, v, w = plane_homography(Camera(), BoardConfig().centre[2]) @ points
    truth = np.zeros((128, 128), bool)
    truth[(v / w).astype(int), (u / w).astype(int)] = True
    found = mask == 0
    assert (found & truth).sum() > 0.9 * truth.sum()
    around = np.zeros_like(truth)
    for dv in (-1, 0, 1):
        for du in (-1, 0, 1):
            around |= np.roll(truth, (dv, du), (0, 1))
    assert (found & ~around).sum() == 0


class Shown:
    """Pictures that the test gives."""

    def __init__(self, photo):
        self.photo, self.number, self.age_ms = photo, 0, 0.0

    def open(self, lockstep):
        pass

    def latest(self, tick):
        return self.photo, self.number, self.age_ms

    def close(self):
        pass


def test_work_begins_with_ink_ends_without_and_needs_sight(arm):
    white = np.full((455, 455, 3), 220, np.uint8)
    inked = white.copy()
    inked[200:206, 150:300] = 20
    pictures = Shown(white)
    work = WipingWork(pictures)
    work.prepare(arm, False)
    seen = np.zeros(1, seen_dtype(7))[0]
    seen["q"] = arm.home

    def look(photo, times):
        for _ in range(times):
            pictures.photo, pictures.number = photo, pictures.number + 1
            work.look(seen, np.zeros(6), -1)

    look(white, 30)
    assert work.is_done()
    assert not work.is_ready()
    speck = white.copy()
    speck[197:201, 198:202] = 20  # of 5 mm across, where four pixels of the mask meet
    look(speck, 50)  # too small to begin with, but what has been begun is gone on with for a while
    assert work.seen_with()[1] == 4
    assert not work.is_done()
    assert not work.is_ready()
    look(speck, 40)
    assert work.is_done()
    look(inked, 10)
    assert work.is_ready()
    assert not work.is_done()
    assert not work.is_blind()
    pictures.age_ms = math.inf
    work.look(seen, np.zeros(6), 0)
    assert work.is_blind()


def test_ink_that_does_not_become_less_is_looked_at_anew(arm):
    """A policy that remembers nothing once circled one spot of ink for six minutes."""
    pictures = Shown(np.full((455, 455, 3), 220, np.uint8))
    work, slow = WipingWork(pictures), WipingWork(pictures)
    work.prepare(arm, False)
    slow.prepare(arm, False, 0.2)
    seen = np.zeros(1, seen_dtype(7))[0]
    seen["q"] = arm.home

    def look(columns, steps, times):
        pictures.photo[:] = 220
        pictures.photo[200:206, 150 : 150 + columns] = 20
        for _ in range(times):
            pictures.number += 1
            for one in (work, slow):
                one.look(seen, np.zeros(6), steps)

    look(150, -1, 400)
    look(150, 0, 1)
    assert not work.is_stalled()
    look(150, 1, 100)
    look(100, 101, 100)  # some of it is gone
    assert not work.is_stalled()
    look(120, 201, 100)
    assert work.is_stalled()
    assert not slow.is_stalled()
    look(0, -1, 200)  # from the start the arm hides it
    assert not work.is_stalled()
    assert work.is_ready()
    look(0, 0, 1)
    look(0, 1, 10)
    assert not work.is_done()
    look(0, 11, 20)
    assert work.is_done()
    look(0, -1, 200)
    assert not work.is_ready()


@pytest.mark.parametrize("speed", [1.0, 0.2])
def test_a_policy_that_stood_still_between_two_strokes_is_shown_the_nearest_alone(arm, speed):
    white = np.full((455, 455, 3), 220, np.uint8)
    white[200:206, 150:200] = white[300:306, 260:310] = 20
    work = WipingWork(Shown(white))
    work.prepare(arm, False, speed)
    seen = np.zeros(1, seen_dtype(7))[0]
    seen["q"] = [1.5, *arm.home[1:]]  # aside

    def rows_of_ink(position, looks):
        """Return the mask's rows that show ink after so many new pictures, the tool being at this x and y."""
        for step in range(looks):
            work.pictures.number += 1
            mask = work.look(seen, np.array([*position, 0.0, 0.0, 0.0, 0.0]), step)["mask"][..., 0]
        return np.flatnonzero((mask == 0).any(axis=1))

    behind, before = (0.42, -0.05), (0.62, 0.05)  # the camera looks from the front: x is down in its picture
    assert rows_of_ink(behind, 50).min() < 60
    assert rows_of_ink(behind, 50).max() > 80
    assert rows_of_ink(behind, round(70 / speed)).max() < 60
    assert rows_of_ink(before, round(70 / speed)).min() > 80


def hiding(arm):
    """Return work, and what lets it look at a line of ink or none, behind the arm or not, for so many pictures."""
    white, hides = np.full((455, 455, 3), 220, np.uint8), np.zeros((455, 455), np.uint8)
    inked, pictures = white.copy(), Shown(white)
    inked[200:206, 200:260] = 20
    work = WipingWork(pictures)
    work.prepare(arm, False)
    work._eye.hidden = lambda solids: hides
    seen = np.zeros(1, seen_dtype(7))[0]
    seen["q"] = arm.home

    def look(is_inked, hidden, steps, times):
        hides[180:225, 180:280] = 255 * hidden
        for _ in range(times):
            pictures.photo, pictures.number = inked if is_inked else white, pictures.number + 1
            work.look(seen, np.zeros(6), steps)

    return work, look


def test_ink_that_the_arm_hides_is_ink_until_it_is_seen_to_be_gone(arm):
    """From the start the arm hides a part of the board; six per cent of the ink were left behind it."""
    work, look = hiding(arm)
    look(True, False, -1, 10)
    look(True, False, 0, 5)
    look(True, True, 5, 40)
    assert not work.is_done()
    look(False, False, 45, 25)
    assert work.is_done()
    look(True, False, 70, 5)
    look(True, True, 75, 100)
    assert work.is_done()  # it does not wait for ever


def test_work_that_was_given_up_remembers_what_the_arm_hides(arm):
    work, look = hiding(arm)
    look(True, False, -1, 10)
    look(True, False, 0, 1)
    look(True, False, 1, 160)
    assert work.is_stalled()
    look(True, True, -1, 100)  # from the start the arm hides it
    assert work.is_ready()
    look(True, True, 0, 1)
    look(True, True, 1, 60)
    assert not work.is_done()


def test_force_is_what_is_more_than_in_the_air(arm):
    """A load or friction that the model does not know is no board; nor is a push, whatever the controller's mode."""
    white = np.full((455, 455, 3), 220, np.uint8)
    white[200:206, 150:300] = 20
    work, rng = WipingWork(Shown(white)), np.random.default_rng(2)
    work.prepare(arm, False)
    seen = np.zeros(1, seen_dtype(7))[0]
    seen["q"] = arm.home

    def look(steps, force, mode=FREE, moved_m=0.0, times=1):
        for _ in range(times):
            work.pictures.number += 1
            seen["mode"], seen["force"] = mode, np.add(force, rng.normal(0.0, 0.2, 3))
            seen["position"][2] += moved_m
            observed = work.look(seen, np.zeros(6), steps)
        return observed["force"]

    look(-1, (3.0, 0.0, -4.0), moved_m=-0.002, times=100)  # on the way
    assert not work.is_ready()
    look(-1, (0.1, -0.3, 0.8), times=60)
    assert work.is_ready()
    look(-1, (0.0, 0.0, -20.0), mode=REJECT, times=60)
    look(-1, (0.0, 0.0, -10.0), times=25)  # a push at the tool, for less than half a second
    np.testing.assert_allclose(look(0, (0.1, -0.3, 6.8)), [0.0, 0.0, 6.0], atol=1.2)
    mean = np.mean([look(1, (0.1, -0.3, 6.8)) for _ in range(200)], axis=0)
    np.testing.assert_allclose(mean, [0.0, 0.0, 6.0], atol=0.25)


def test_an_arm_that_had_moved_on_since_the_picture_was_ink(arm):
    """What hides the board is the arm where it was when the picture was taken, not where it is."""
    shown = Shown(np.full((455, 455, 3), 200, np.uint8))
    work, postures = WipingWork(shown), []
    work.prepare(arm, True)
    solids_at = work._eye.solids_at
    work._eye.solids_at = lambda q: postures.append(q) or solids_at(q)
    seen = np.zeros(1, seen_dtype(7))[0]
    for tick in range(17, 200, 17):
        seen["q"], seen["tick"] = arm.home + 0.001 * tick, tick
        shown.number, shown.age_ms = tick, 40.0
        work.look(seen, np.zeros(6), 0)
    np.testing.assert_allclose(postures[-1], arm.home + 0.001 * (187 - 40), atol=1e-9)
    work.close()
