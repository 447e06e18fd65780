"""Recording runs, tick by tick."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from tests.tasks.wiping.tasks_by_script import wipe_nearest

from contactsafe.experiments.run import run_policy
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.scenes import WipingEpisodes
from contactsafe.tasks.wiping.tasks import WipingTasks

SPOT = np.zeros((30, 30))
SPOT[13:16, 13:16] = 1


def begun(n, *drawings):
    def begin(tasks, i, rng):
        tasks.reset(i, rng, drawing=drawings[i] if drawings else None)

    return WipingEpisodes(WipingTasks(WipingConfig(), n, 0), range(n), begin)


def still(observation):
    return np.zeros((len(observation["pose"]), 18))


def test_every_tick_is_in_the_trace_once():
    run = run_policy(begun(2), still, 30)
    for trace, curves in zip(run.traces, run.curves, strict=True):
        assert_allclose(trace["time"], np.arange(500) / 1000)
        assert_array_equal(curves["ink_left"], np.ones(500))
    assert_array_equal(run.ended, 30)


def test_pictures_are_kept_every_fifth_of_a_second_from_the_start():
    run = run_policy(begun(1), still, 30)
    assert run.pictures.shape[:2] == (3, 1)
    assert run.picture_every == 200
    recording = run.recording(0, "wiping", "safe", 0)
    assert_array_equal(recording.pictures[0], recording.pictures[-1])
    assert_array_equal(recording.picture(0), recording.picture(499))


def test_a_trace_ends_with_its_episode_and_the_others_go_on():
    episodes = begun(2, SPOT, np.ones((1, 1)))
    run = run_policy(episodes, lambda observation: wipe_nearest(episodes.tasks, 0), 200, to_the_end=False)
    assert run.ended[0] < 200
    assert run.ended[1] == 200
    assert run.succeeded.tolist() == [True, False]
    assert run.curves[0]["ink_left"][-1] == 0.0
    assert len(run.traces[1]) == len(run.curves[1]["ink_left"]) == 66 * 50 + 17 + 17
    assert len(run.traces[0]) == np.sum(np.where(np.arange(run.ended[0]) % 3 == 2, 16, 17))
