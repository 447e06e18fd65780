"""The mask: a pinhole's view of the board, ink 0 and all else 255, hidden by the arm's silhouette."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.sim.scenes import BOARD_Z, DOWN, posture
from tests.tasks.wiping.boards_in_worlds import BOARD
from tests.tasks.wiping.boards_in_worlds import scene as make_scene

from contactsafe.core.rotation import quat_multiply, rotvec_to_quat
from contactsafe.sim.config import WorldConfig
from contactsafe.tasks.wiping.board import Camera, furnish
from contactsafe.tasks.wiping.camera import camera_axes, plane_homography
from contactsafe.tasks.wiping.whiteboard import CLEAN, INK

CAMERA = Camera()
AWAY = (0.35, 0.0, 0.5)


@pytest.fixture(scope="module")
def scene():
    return make_scene()


def pinhole(camera, point):
    """Project by hand: z forward along the line of sight, x right and level, y down; the middle is (size / 2)²."""
    line = np.subtract(camera.target, camera.position)
    z = line / math.sqrt(line @ line)
    x = np.array([z[1], -z[0], 0.0]) / math.hypot(z[0], z[1])
    y = np.cross(z, x)
    away = np.subtract(point, camera.position)
    depth = away @ z
    middle = camera.size / 2
    return np.array([middle + camera.focal_px * (away @ x) / depth, middle + camera.focal_px * (away @ y) / depth])


def by_homography(camera, x, y, z=BOARD_Z):
    u, v, w = plane_homography(camera, z) @ (x, y, 1.0)
    return np.array([u / w, v / w])


@pytest.mark.parametrize(
    "camera", [CAMERA, Camera(position=(0.9, -0.7, 0.8), target=(0.45, 0.1, 0.05), focal_px=150.0, size=96)]
)
def test_homography_is_the_pinhole_of_the_board(camera):
    for x in (0.25, 0.35, 0.5, 0.75):
        for y in (-0.3, 0.0, 0.15, 0.3):
            assert_allclose(by_homography(camera, x, y), pinhole(camera, (x, y, BOARD_Z)), rtol=0, atol=1e-9)


def test_the_target_is_in_the_middle_and_the_far_edge_of_the_board_on_top():
    assert_allclose(by_homography(CAMERA, 0.5, 0.0), (64.0, 64.0), atol=1e-9)
    near, far = by_homography(CAMERA, 0.65, 0.0), by_homography(CAMERA, 0.35, 0.0)
    assert far[1] < 64.0 < near[1]  # the camera faces the robot
    assert by_homography(CAMERA, 0.5, 0.1)[0] > 64.0


def test_the_whole_ink_area_is_in_view():
    for x in (0.35, 0.65):
        for y in (-0.15, 0.15):
            assert ((by_homography(CAMERA, x, y) > 0) & (by_homography(CAMERA, x, y) < 128)).all()


def test_camera_axes_are_a_right_handed_frame():
    R = camera_axes(Camera(position=(0.9, -0.7, 0.8)))
    assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert_allclose(np.linalg.det(R), 1.0)


def test_a_cell_of_ink_marks_the_pixel_it_is_seen_in(scene):
    scene.place(posture(AWAY))
    board = scene.board
    for i, j in ((90, 100), (125, 150), (170, 220)):
        board.clear()
        board.cells[i, j] = INK
        u, v = by_homography(CAMERA, *(board.origin + (np.array([i, j]) + 0.5) * 0.002))
        mask = scene.mask()
        assert mask[int(v), int(u)] == 0
        assert np.count_nonzero(mask == 0) <= 4  # a cell is smaller than a pixel
        rows, columns = np.nonzero(mask == 0)
        assert np.abs(rows + 0.5 - v).max() < 1.5
        assert np.abs(columns + 0.5 - u).max() < 1.5


def test_a_mask_holds_0_and_255_only_and_a_clean_board_is_blank(scene):
    board = scene.board
    board.clear()
    scene.place(posture((0.5, 0.0, BOARD_Z + 0.02)))
    assert (scene.mask() == 255).all()
    board.sample_random(np.random.default_rng(0))
    assert set(np.unique(scene.mask())) == {0, 255}


def test_a_dark_object_looks_like_ink(scene):
    board = scene.board
    scene.place(posture(AWAY))
    board.clear()
    board.place_object((0.5, 0.05), (0.06, 0.06))
    u, v = by_homography(CAMERA, 0.5, 0.05)
    assert scene.mask()[int(v), int(u)] == 0


def test_the_arm_hides_ink(scene):
    """All ink behind the pad and the hand is out of view; all the rest stays."""
    board = scene.board
    board.clear()
    board.paint(np.ones((1, 1)))
    scene.place(posture(AWAY))
    free = scene.mask().copy() == 0
    scene.place(posture((0.5, 0.0, BOARD_Z)))
    seen = scene.mask() == 0
    assert not (seen & ~free).any()
    u, v = by_homography(CAMERA, 0.5, 0.0)
    assert not seen[int(v), int(u)]
    assert 0.1 < 1.0 - seen.sum() / free.sum() < 0.6
    for x, y in ((0.62, 0.12), (0.62, -0.12)):  # before and beside the arm
        u, v = by_homography(CAMERA, x, y)
        assert seen[int(v), int(u)]


def nearly_clean(board):
    """A random drawing with a broad track wiped through it."""
    board.sample_random(np.random.default_rng(4))
    area = (board.cells == INK).any(axis=0).nonzero()[0]
    board.cells[:, area[len(area) // 5] : area[-len(area) // 5]] = CLEAN


BOARDS = {
    "strokes": lambda board: board.sample_random(np.random.default_rng(1)),
    "other strokes": lambda board: board.sample_random(np.random.default_rng(7)),
    "nearly clean": nearly_clean,
    "covered": lambda board: board.paint(np.ones((1, 1))),
}
POSES = {
    "pressing": ((0.5, 0.0, BOARD_Z - 0.001), (0.0, 0.0, 0.0)),
    "aside and turned": ((0.42, 0.12, BOARD_Z + 0.03), (0.05, -0.08, 0.6)),
    "near the camera": ((0.63, -0.1, BOARD_Z + 0.08), (-0.1, 0.1, -0.5)),
    "out of view": (AWAY, (0.0, 0.0, 0.0)),
}


@pytest.mark.render
@pytest.mark.parametrize("drawing", BOARDS)
def test_the_mask_is_mujocos_own_segmentation_of_the_same_scene(scene, drawing):
    from tests.tasks.wiping.inked_scene import Renderings

    scene.board.clear()
    BOARDS[drawing](scene.board)
    overlaps = {}
    with Renderings(furnish(WorldConfig(), BOARD), scene.board, CAMERA) as renderings:
        for pose, (position, tilt) in POSES.items():
            q = posture(position, quat_multiply(rotvec_to_quat(np.array(tilt)), DOWN))
            scene.place(q)
            ours, theirs = scene.mask() == 0, renderings.mask(q)
            overlaps[pose] = (ours & theirs).sum() / (ours | theirs).sum()
    assert min(overlaps.values()) >= 0.95, overlaps


@pytest.mark.render
def test_specks_of_ink_are_not_lost_nor_invented(scene):
    """Squares of 6 mm, little more than a pixel: each is where MuJoCo shows one, give or take a pixel."""
    from tests.tasks.wiping.inked_scene import Renderings

    scene.board.clear()
    scene.board.paint(np.random.default_rng(2).uniform(size=(50, 50)) < 0.02)
    q = posture(AWAY)
    scene.place(q)
    with Renderings(furnish(WorldConfig(), BOARD), scene.board, CAMERA) as renderings:
        ours, theirs = scene.mask() == 0, renderings.mask(q)
    assert theirs.sum() > 100
    assert not (ours & ~grown(theirs)).any()
    assert not (theirs & ~grown(ours)).any()
    assert (ours & theirs).sum() / (ours | theirs).sum() > 0.9


def grown(mask):
    """The mask and every pixel beside it."""
    padded = np.pad(mask, 1)
    return np.any([padded[1 + i : 129 + i, 1 + j : 129 + j] for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)
