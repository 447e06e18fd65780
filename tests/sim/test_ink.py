"""What is kept of the ink from look to look is what a look at the whole board would find."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from contactsafe.envs.config import WipingConfig
from contactsafe.envs.tasks import WipingTasks
from contactsafe.sim.camera import camera_at, render_mask
from contactsafe.sim.config import BoardConfig, Camera, WorldConfig
from contactsafe.sim.ink import enter, nearest_ink
from contactsafe.sim.randomisation import Randomisation
from contactsafe.sim.whiteboard import INK, OBJECT


def wiping(tasks, steps, seed):
    """Press and move at random."""
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        actions = 0.5 * rng.standard_normal((tasks.worlds.n, 18))
        actions[:, 2] -= 0.3
        tasks.step(actions)


def whole_masks(worlds):
    """Draw every mask from the cells alone, by the camera that looks at them."""
    masks = np.zeros_like(worlds.masks)
    for i in range(worlds.n):
        camera = camera_at(worlds.cameras, worlds.plants[i]["camera"])
        render_mask(camera, worlds.cells[i], worlds.plants[i], masks[i])
    return masks


@pytest.fixture(scope="module")
def tasks():
    """Boards of which much is wiped, each under another camera; pictures as they are."""
    ranges = Randomisation(camera_m=(-0.02, 0.02), camera_rad=(-0.03, 0.03))
    tasks = WipingTasks(WipingConfig(randomisation=ranges), 3, seed=0)
    for i in range(3):
        tasks.reset(i, np.random.default_rng(i), drawing=np.ones((2, 2)), start=(0.5, 0.0, 0.02))
    return tasks


def test_the_mask_is_that_of_the_whole_board(tasks):
    before = tasks.worlds.ink_cells()
    wiping(tasks, 90, 0)
    assert (tasks.worlds.ink_cells() < before - 500).all()
    assert_array_equal(tasks.worlds.masks, whole_masks(tasks.worlds))


def test_ink_is_counted_and_the_nearest_found(tasks):
    wiping(tasks, 30, 1)
    worlds = tasks.worlds
    assert_array_equal(tasks.tasks["ink"], worlds.ink_cells())
    cell = worlds.plants[0]["cell"]
    for i in range(worlds.n):
        position = worlds.plants[i]["origin"] + (0.07, 0.11)
        at = worlds.plants[i]["origin"] + (np.argwhere(worlds.cells[i] == INK) + 0.5) * cell
        count, distance = nearest_ink(worlds.ledger, i, worlds.cells[i], worlds.plants[i]["origin"], cell, position)
        assert count == len(at)
        assert distance == pytest.approx(np.linalg.norm(at - position, axis=1).min(), abs=1e-12)


def test_what_is_drawn_or_laid_amid_an_episode_is_seen_and_an_object_is_no_ink(tasks):
    worlds = tasks.worlds
    wiping(tasks, 1, 2)
    ink = worlds.ink_cells()[1]
    worlds.boards[1].place_object((0.4, 0.1), (0.03, 0.03))
    wiping(tasks, 1, 3)
    assert (worlds.cells[1] == OBJECT).sum() == 225
    assert_array_equal(worlds.masks, whole_masks(worlds))
    assert tasks.tasks["ink"][1] <= ink


@pytest.mark.parametrize("size", [(0.31, 0.37), (0.302, 0.302)])
def test_a_board_of_any_size_is_gone_through_to_its_last_cell(size):
    board = BoardConfig(size=size, ink_size=0.3)
    tasks = WipingTasks(WipingConfig(world=WorldConfig(board=board)), 1, seed=0)
    worlds = tasks.worlds
    worlds.cells[0, -1, -1] = worlds.cells[0, 0, 0] = INK
    enter(worlds.ledger, 0, worlds.cells[0], worlds.cameras.pixels[0])
    assert worlds.ledger.count[0] == 2
    assert_array_equal(worlds.ledger.cells[0, 1], np.subtract(worlds.cells[0].shape, 1))


@pytest.mark.parametrize("size", [96, 90, 81])
def test_a_mask_of_any_size_is_drawn_and_spoiled_to_its_last_pixel(size):
    camera = Camera(size=size, focal_px=180.0 * size / 128)
    config = WipingConfig(world=WorldConfig(camera=camera), randomisation=Randomisation(delay_steps=(1, 1)))
    tasks = WipingTasks(config, 1, seed=0)
    tasks.reset(0, np.random.default_rng(0), drawing=np.ones((2, 2)), start=(0.5, 0.0, 0.1))
    worlds, last = tasks.worlds, []
    worlds.ledger.shown[0, -1, -1] = 1
    for _ in range(3):
        tasks.step(np.zeros((1, 18)))
        last.append(worlds.masks[0, -1, -1])
    assert last == [255, 0, 0]  # late by one
