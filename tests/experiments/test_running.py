"""Recording runs, tick by tick."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from tests.tasks.wiping.tasks_by_script import wipe_nearest

from contactsafe.experiments.run import holding, run_policy
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.tasks import WipingTasks

SPOT = np.zeros((30, 30))
SPOT[13:16, 13:16] = 1


def tasks_at_start(n, drawing=None):
    tasks = WipingTasks(WipingConfig(), n, 0)
    for i in range(n):
        tasks.reset(i, np.random.default_rng(i), drawing=drawing)
    return tasks


def test_every_tick_is_in_the_trace_once():
    run = run_policy(tasks_at_start(2), holding(), 30, stop_when_clean=False)
    for trace in run.traces:
        assert_allclose(trace["time"], np.arange(500) / 1000)
        assert_array_equal(trace["ink_left"], 1.0)
    assert_array_equal(run.ended, 30)


def test_boards_are_kept_every_fifth_of_a_second_from_the_start():
    run = run_policy(tasks_at_start(1), holding(), 30, stop_when_clean=False)
    assert run.boards.shape[:2] == (3, 1)
    assert run.board_every == 200
    recording = run.recording(0, "wiping", "safe", 0)
    assert_array_equal(recording.boards[0], recording.boards[-1])


def test_a_trace_ends_when_its_board_is_clean_and_the_others_go_on():
    tasks = tasks_at_start(2, SPOT)
    tasks.reset(1, np.random.default_rng(1), drawing=np.ones((1, 1)))

    def act(observation):
        return wipe_nearest(tasks, 0)

    run = run_policy(tasks, act, 200, stop_when_clean=True)
    assert run.ended[0] < 200
    assert run.ended[1] == 200
    assert run.traces[0]["ink_left"][-1] == 0.0
    assert len(run.traces[1]) == 66 * 50 + 17 + 17
    assert len(run.traces[0]) == np.sum(np.where(np.arange(run.ended[0]) % 3 == 2, 16, 17))
