"""What is kept of the ink from look to look is what a look at the whole board would find."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.bullet_backend import BulletBackend
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.camera import camera_at, render_mask
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.ink import nearest_ink
from contactsafe.tasks.wiping.randomisation import Randomisation
from contactsafe.tasks.wiping.tasks import WipingTasks
from contactsafe.tasks.wiping.whiteboard import INK, OBJECT

FULL = np.ones((2, 2))


def begun(tasks):
    """Begin on full boards, low over their middles."""
    for i in range(tasks.worlds.n):
        tasks.reset(i, np.random.default_rng(i), drawing=FULL, start=(0.5, 0.0, 0.02))
    return tasks


def other_cameras(n=3):
    """Make tasks each under another camera, pictures as they are."""
    ranges = Randomisation(camera_m=(-0.02, 0.02), camera_rad=(-0.03, 0.03))
    return begun(WipingTasks(WipingConfig(randomisation=ranges), n, seed=0))


def wiping(tasks, steps, seed=0):
    """Press and move at random."""
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        actions = 0.5 * rng.standard_normal((tasks.worlds.n, 18))
        actions[:, 2] -= 0.3
        tasks.step(actions)


def whole_masks(tasks):
    """Render every mask from the cells alone, by the camera that looks at them."""
    boards = tasks.boards
    masks = np.zeros_like(boards.masks)
    for i in range(boards.n):
        camera = camera_at(boards.cameras, boards.records[i]["camera"])
        render_mask(camera, boards.cells[i], tasks.worlds.records[i]["plant"], masks[i])
    return masks


def test_the_mask_is_that_of_the_whole_board():
    tasks = other_cameras()
    boards = tasks.boards
    assert len(set(boards.records["camera"])) > 1
    before = boards.ink_cells()
    wiping(tasks, 90)
    assert (boards.ink_cells() < before - 500).all()
    assert_array_equal(boards.masks, whole_masks(tasks))
    boards.boards[1].place_object((0.4, 0.1), (0.03, 0.03))
    boards.cells[2, 10, 10:20] = INK
    boards.boards[2].changed = True
    wiping(tasks, 1)
    assert (boards.cells[1] == OBJECT).any()
    assert_array_equal(boards.masks, whole_masks(tasks))


def test_the_same_in_the_second_engine():
    pytest.importorskip("pybullet")
    tasks = begun(WipingTasks(WipingConfig(), 1, seed=0, backend=BulletBackend))
    before = tasks.boards.ink_cells()
    wiping(tasks, 60)
    tasks.boards.boards[0].place_object((0.4, 0.1), (0.03, 0.03))
    wiping(tasks, 1)
    assert (tasks.boards.ink_cells() < before).all()
    assert_array_equal(tasks.boards.masks, whole_masks(tasks))


def test_ink_is_counted_and_the_nearest_found_and_an_object_is_no_ink():
    tasks = other_cameras(2)
    boards = tasks.boards
    boards.boards[1].place_object((0.4, 0.1), (0.03, 0.03))
    wiping(tasks, 60)
    assert_array_equal(tasks.tasks["ink"], boards.ink_cells())
    cell = boards.records[0]["cell"]
    for i in range(boards.n):
        origin = boards.records[i]["origin"]
        at = origin + (np.argwhere(boards.cells[i] == INK) + 0.5) * cell
        place = np.add(origin, [0.07, 0.11])
        count, distance = nearest_ink(boards.ink_index, i, boards.cells[i], origin, cell, place)
        assert count == len(at)
        assert distance == pytest.approx(np.linalg.norm(at - place, axis=1).min(), abs=1e-12)


@pytest.mark.parametrize(
    ("board", "camera"),
    [
        (BoardConfig(size=(0.302, 0.302), ink_size=0.3), Camera(size=81, focal_px=110.0)),
        (BoardConfig(size=(0.31, 0.37), ink_size=0.3), Camera(size=90, focal_px=120.0)),
    ],
)
def test_boards_and_masks_of_any_size_are_gone_through_to_their_last(board, camera):
    """Late by one picture, so that pictures are copied as well."""
    config = WipingConfig(board=board, camera=camera, randomisation=Randomisation(delay_steps=(1, 1)))
    tasks = begun(WipingTasks(config, 3, seed=0))
    boards = tasks.boards
    boards.cells[:, -1, -1] = boards.cells[:, 0, 0] = INK
    for one in boards.boards:
        one.changed = True
    wiping(tasks, 1)
    now = whole_masks(tasks)
    assert_array_equal(tasks.tasks["ink"], boards.ink_cells())
    wiping(tasks, 1)
    assert_array_equal(boards.masks, now)


def test_another_camera_is_noticed_without_a_look():
    tasks = other_cameras(1)
    boards, first = tasks.boards, int(tasks.boards.records[0]["camera"])
    seed = 0
    while boards.records[0]["camera"] == first:
        tasks._variation.sample(0, np.random.default_rng(seed := seed + 1))
    tasks.worlds.reset(0, tasks.worlds.records[0]["errors"]["q_seen"])
    wiping(tasks, 30)
    assert_array_equal(boards.masks, whole_masks(tasks))


def test_more_cells_in_a_pixel_than_are_counted_are_refused():
    config = WipingConfig(
        board=BoardConfig(size=(0.3, 0.3), ink_size=0.3, cell=0.001), camera=Camera(size=1, focal_px=1.0)
    )
    with pytest.raises(InvalidInputError) as caught:
        WipingTasks(config, 1, seed=0)
    assert str(caught.value) == (
        "one pixel of the camera shows 90000 cells of a board of (300, 300); at most 65535 and 32767 rows can be "
        "counted: make the board's cell larger"
    )
