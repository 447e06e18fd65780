"""A camera that stands elsewhere over a board that lies elsewhere: the policy sees what it saw in training."""

import dataclasses
import math

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware.messages import seen_dtype
from contactsafe.robot import robots
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.robot_board import create_shown, map_shown

pytest.importorskip("cv2")
pytest.importorskip("pyrealsense2", exc_type=ImportError)  # or without libusb

import cv2
from tests.vision.rendered import D455, TARGET, looking, picture, turn

from contactsafe.tasks.wiping.camera import camera_axes, plane_homography
from contactsafe.tasks.wiping.photograph import corners_of
from contactsafe.tasks.wiping.placed_camera import TILT_RAD, PlacedCamera
from contactsafe.tasks.wiping.robot import WipingRobot
from contactsafe.tasks.wiping.robot_photographs import PhotographedBoard, camera_over, turned_from
from contactsafe.tasks.wiping.robot_work import WipingWork
from contactsafe.vision.camera_calibration import CameraCalibration
from contactsafe.vision.camera_pose import find_camera
from contactsafe.vision.rigid import pose_of
from contactsafe.vision.silhouette import on_plane

TRAINED = BoardConfig().centre

STANDS = {
    "as in training": looking((0.55, 0.0, 0.64)),
    "on the left": looking((0.5, 0.27, 0.6), at=(0.02, 0.0, 0.0)),
    "on the right": looking((0.48, -0.26, 0.65), at=(0.0, 0.03, 0.0), roll=0.5),
    "upside down": looking((0.45, -0.24, 0.6), roll=3.0),
}
"""Cameras, from the board's middle."""

LYING = {
    "as in training": pose_of(np.eye(3), TRAINED),
    "elsewhere": pose_of(turn([0.0, 0.0, math.radians(90 + 4)]), np.add(TRAINED, [-0.04, 0.07, 0.03])),
}
"""Targets, in the base."""


@pytest.fixture(scope="module")
def arm():
    return robots.fr3("wiper")


def placed_at(stand, lying=LYING["as in training"], middle=None):
    """Return a camera that was calibrated without any error."""
    middle = pose_of(np.eye(3), lying[:3, 3]) if middle is None else middle
    return PlacedCamera(CameraCalibration(D455, middle @ stand, lying, "42"), BoardConfig(), Camera())


def drawing():
    """Draw strokes of 6 mm, some of them short, (150, 150)."""
    cells, rng = np.zeros((150, 150), np.uint8), np.random.default_rng(3)
    for _ in range(6):
        points = np.clip(np.cumsum(rng.uniform(-30, 30, (5, 2)), axis=0) + rng.uniform(30, 120, 2), 4, 145)
        cv2.polylines(cells, [points.astype(np.int32)], False, 1, 3)
    return cells


def on_board(cells):
    """Put the drawing into the middle of a board's cells."""
    cells = np.zeros_like(cells)
    rows, columns = ((edge - 150) // 2 for edge in cells.shape)
    cells[rows : rows + 150, columns : columns + 150] = drawing()
    return cells


def looked(folder, arm, q, placed=None, stands=None, seed=2):
    """Return the ink and the pose that a policy sees before the drawing.

    Args:
        folder: for what the board shows.
        arm, q: before it.
        placed: as it was calibrated; None for camera and board of training.
        stands: as it really is.
        seed: of light and noise.
    """
    stands = stands or placed
    create_shown(folder / "board", BoardConfig())
    shown = map_shown(folder / "board", BoardConfig())[0]
    shown["q"], shown["cells"] = q, on_board(shown["cells"])
    board = BoardConfig() if stands is None else stands.board
    pictures = PhotographedBoard(folder / "board", arm, board, Camera(), seed, stands)
    work = WipingWork(pictures, placed=placed)
    work.prepare(arm, True)
    if placed is not None:
        pictures._view = placed.view()
    seen = np.zeros(1, seen_dtype(7))[0]
    seen["q"], seen["tick"] = q, 40
    observed = work.look(seen, np.zeros(6), 0)
    work.close()
    return observed["mask"][..., 0] == 0, observed.get("pose", np.zeros(6))


def overlap(a, b):
    """Return intersection over union."""
    return (a & b).sum() / (a | b).sum()


def around(mask):
    """Return a mask with a pixel more on every side."""
    return cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0


AWAY = np.array([2.7, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
OVER_THE_BOARD = np.array([0.0, 0.333, 0.0, -2.392, 0.0, 2.725, 0.785])


@pytest.fixture(scope="module")
def known(arm, tmp_path_factory):
    """Return what the camera of training sees."""
    return looked(tmp_path_factory.mktemp("known"), arm, AWAY)[0]


@pytest.mark.parametrize("lying", LYING.values(), ids=LYING)
@pytest.mark.parametrize("stand", STANDS.values(), ids=STANDS)
def test_ink_is_where_the_camera_of_training_saw_it(known, arm, tmp_path, stand, lying):
    """Through the lens, from another place and over a board elsewhere, under the same light."""
    placed = placed_at(stand, lying)
    seen, pose = looked(tmp_path, arm, AWAY, placed)
    assert known.sum() > 400
    assert overlap(seen, known) > 0.85
    assert not (seen & ~around(known)).any()
    np.testing.assert_allclose(pose[:3], np.array(TRAINED) - lying[:3, 3], atol=1e-12)
    np.testing.assert_allclose(placed.plane @ [*TRAINED[:2], 1.0], lying[:3, 3], atol=1e-12)


@pytest.mark.parametrize("stand", list(STANDS.values())[1:], ids=list(STANDS)[1:])
def test_the_arm_hides_ink_from_where_the_camera_stands_and_is_none(known, arm, tmp_path, stand):
    seen, _ = looked(tmp_path, arm, OVER_THE_BOARD, placed_at(stand))
    assert not (seen & ~around(known)).any()
    assert 0.5 * known.sum() < seen.sum() < 0.95 * known.sum()


def test_calibrated_from_pictures_the_ink_is_there_too(known, arm, tmp_path):
    """The whole path: pictures of the printed target, its pose by touch, and then the drawing."""
    stand, lying = STANDS["on the left"], LYING["elsewhere"]
    on_target = np.linalg.inv(turn_of(lying)) @ stand
    pose = find_camera(TARGET, D455, [TARGET.find(picture(on_target, seed)) for seed in range(3)])
    jolt = pose_of(turn([0.003, -0.002, 0.004]), [0.0008, -0.0005, 0.0006])
    calibrated = CameraCalibration(D455, lying @ jolt @ pose.pose_target_camera, lying @ jolt)
    seen, _ = looked(tmp_path, arm, AWAY, PlacedCamera(calibrated, BoardConfig(), Camera()), placed_at(stand, lying))
    assert overlap(seen, known) > 0.75
    assert not (seen & ~around(around(known))).any()


def turn_of(pose):
    return pose_of(pose[:3, :3], np.zeros(3))


def test_without_calibration_another_camera_is_of_no_use(known, arm, tmp_path):
    """The check that the tests above are ones of the calibration: 10 cm beside it the ink is elsewhere."""
    placed = placed_at(looking((0.55, 0.1, 0.64), at=(0.0, 0.1, 0.0)))
    seen, _ = looked(tmp_path, arm, AWAY, placed_at(STANDS["as in training"]), placed)
    assert overlap(seen, known) < 0.3


@pytest.mark.parametrize(("stand", "lying", "told"), [
    ("on the left", pose_of(np.eye(3), [0.65, 0.0, 0.01]), r"150 mm aside and \+0 mm high .* allowed 100 and 50 mm"),
    ("on the left", pose_of(np.eye(3), [0.5, 0.0, 0.07]), r"0 mm aside and \+60 mm high"),
    ("on the left", pose_of(turn([0.03, 0.0, 0.0]), TRAINED), r"tilted by 1\.72°, allowed 0\.97°; level it"),
    ("on the left", pose_of(turn([0.0, 0.0, 0.6]), TRAINED), "turned by 34° .* allowed 20°"),
    (looking((0.55, 0.0, 0.64), at=(0.0, 0.5, 0.0)), LYING["as in training"], r"sees \d+ % of .* allowed 100 %"),
    (looking((-0.3, 0.4, 0.7)), LYING["as in training"], r"127° round the board .* allowed 30°: .* opposite the robot"),
    (looking((0.9, 0.0, 0.2)), LYING["as in training"], r"at \d+ pixels a metre .* allowed 250"),
    (looking((1.0, 0.0, 0.5), at=(3.0, 0.0, 1.0)), LYING["as in training"], "shows nothing of the plane"),
])  # fmt: skip
def test_what_the_task_cannot_do_is_refused_in_one_line(stand, lying, told):
    with pytest.raises(InvalidInputError, match=told) as caught:
        placed_at(STANDS[stand] if isinstance(stand, str) else stand, lying)
    assert "\n" not in str(caught.value)


def test_tilt_within_training_is_taken_and_lifts_the_plane():
    lying = pose_of(turn([0.0, -0.9 * TILT_RAD, 0.0]), TRAINED)
    heights = [placed_at(STANDS["on the left"], lying).plane @ [x, 0.0, 1.0] for x in (0.4, 0.6)]
    assert heights[1][2] - heights[0][2] == pytest.approx(0.2 * math.tan(0.9 * TILT_RAD))


@pytest.mark.parametrize("quarter", range(4))
def test_a_target_may_lie_either_way_up(quarter):
    lying = pose_of(turn([0.0, 0.0, quarter * math.pi / 2 + 0.05]), TRAINED)
    assert placed_at(STANDS["on the left"], lying).turned_rad == pytest.approx(0.05)


def test_the_work_goes_where_the_board_is_and_asks_for_its_camera():
    calibration = placed_at(STANDS["on the left"], LYING["elsewhere"]).calibration
    work = WipingRobot().work(camera_calibration=calibration)
    np.testing.assert_allclose(work.centre, LYING["elsewhere"][:3, 3])
    np.testing.assert_allclose(work.start.position - work.centre, [0.0, 0.0, 0.06], atol=1e-12)
    assert work.pictures._serial == "42"
    np.testing.assert_array_equal(work.homography, WipingWork(None).homography)
    with pytest.raises(InvalidInputError, match="camera 43 is not the one that was calibrated, 42"):
        WipingRobot().work(camera_calibration=calibration, camera="43")


def test_a_device_with_another_lens_is_refused():
    placed = placed_at(STANDS["on the left"])
    placed.refuse_other(dataclasses.replace(D455, fx=640.0))
    for change in ({"fx": 700.0}, {"width": 848}):
        with pytest.raises(InvalidInputError, match="calibrate this camera"):
            placed.refuse_other(dataclasses.replace(D455, **change))


def test_a_simulated_run_puts_board_and_camera_where_the_file_says(arm, tmp_path):
    calibration = placed_at(STANDS["on the right"], LYING["elsewhere"]).calibration
    run = WipingRobot().simulated(arm, tmp_path / "shared", 0, 2, False, camera_calibration=calibration)
    try:
        (bench,) = run.scene.fixtures
        np.testing.assert_allclose(bench.position, LYING["elsewhere"][:3, 3])
        np.testing.assert_allclose(run.work.centre, LYING["elsewhere"][:3, 3])
        np.testing.assert_allclose(run.effect._config.centre, LYING["elsewhere"][:3, 3])
        np.testing.assert_allclose(
            camera_over(run.work.pictures._subject.placed).position, calibration.pose_base_camera[:3, 3]
        )
        assert run.work.placed.calibration is calibration
    finally:
        run.close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("stand", STANDS.values(), ids=STANDS)
def test_the_simulated_camera_is_the_calibrated_one(stand):
    """Points of the board are in its picture where the calibrated lens has them."""
    placed = placed_at(stand, LYING["elsewhere"])
    camera = camera_over(placed)
    axes = turned_from(camera, placed)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    known = placed.calibration.pose_base_camera
    np.testing.assert_allclose(camera_axes(camera) @ axes, known[:3, :3], atol=1e-12)
    np.testing.assert_allclose(camera.position, known[:3, 3])
    corners = on_plane(corners_of(placed.board), plane_homography(camera, placed.board.centre[2]))
    assert corners.min() > -1e-6
    assert corners.max() < camera.size + 1e-6


@pytest.mark.parametrize("degrees", [-170, -29, 0, 20, 120])
def test_round_the_board_counts_from_opposite_the_robot(degrees):
    angle = math.radians(degrees)
    stand = looking((0.5 * math.cos(angle), 0.5 * math.sin(angle), 0.6))
    if abs(degrees) > 30:
        with pytest.raises(InvalidInputError, match=f"{abs(degrees)}° round the board"):
            placed_at(stand)
    else:
        assert placed_at(stand).round_rad == pytest.approx(angle)
