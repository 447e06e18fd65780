"""How an episode ends: clean, out of time, or with the arm on the table."""

import numpy as np
import pytest
from tests.tasks.wiping.tasks_by_script import episode, wipe_nearest

from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.tasks import WipingTasks

TASK = WipingConfig()
SPOT = np.zeros((30, 30))
SPOT[13:16, 13:16] = 1


def test_a_clean_board_ends_the_episode_as_a_success():
    _, tasks, terms = episode(TASK, wipe_nearest, n=1, drawing=SPOT)
    assert tasks.tasks["success"][0] == 1
    assert tasks.terminated[0]
    assert not tasks.truncated[0]
    assert tasks.info()["is_success"][0]
    assert len(terms) < 200


def test_time_up_truncates():
    tasks = WipingTasks(WipingConfig(episode_s=0.2))
    tasks.reset(0, np.random.default_rng(0))
    for step in range(12):
        assert not tasks.truncated[0], step
        tasks.step(np.zeros((1, 18)))
    assert tasks.truncated[0]
    assert not tasks.terminated[0]


def on_its_elbow(tasks):
    """Bend the arm so that the forearm, and not the pad, comes down on the table."""
    q = np.array([0.0, 1.55, 0.0, -0.6, 0.0, 2.6, 0.8])
    tasks.worlds.reset(0, q)
    tasks.worlds.controllers[0]["target"]["position"][2] -= 0.2


def test_the_arm_on_the_table_is_punished_once_and_ends_the_episode():
    tasks = WipingTasks(TASK)
    tasks.reset(0, np.random.default_rng(0))
    on_its_elbow(tasks)
    for _ in range(120):
        tasks.step(np.zeros((1, 18)))
        if tasks.terminated[0]:
            break
    assert tasks.info()["arm_touched"][0]
    assert tasks.info()["reward_arm_table"][0] == TASK.reward.arm_table
    assert not tasks.info()["is_success"][0]


@pytest.mark.parametrize("depth", [0.004, 0.01])
def test_the_pad_on_the_board_is_not_the_arm_on_the_table(depth):
    _, tasks, terms = episode(TASK, lambda t, s: wipe_nearest(t, s, depth), n=2, steps=120)
    assert (terms[:, :, 3] > 0).any()
    assert not tasks.tasks["failed"].any()


def test_a_speck_below_the_fraction_counts_as_clean():
    tasks = WipingTasks(TASK)
    tasks.reset(0, np.random.default_rng(0), drawing=np.ones((1, 1)), start=(0.5, 0.0, 0.08))
    cells = tasks.boards.cells[0]
    rows, columns = np.nonzero(cells)
    keep = int(TASK.clean_fraction * len(rows))
    cells[rows[keep + 1 :], columns[keep + 1 :]] = 0
    tasks.step(np.zeros((1, 18)))
    assert not tasks.terminated[0]
    cells[rows[keep], columns[keep]] = 0
    tasks.step(np.zeros((1, 18)))
    assert tasks.terminated[0]
