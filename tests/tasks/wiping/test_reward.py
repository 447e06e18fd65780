"""The reward: its terms by name, their sum, and that nothing pays like finishing."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.tasks.wiping.tasks_by_script import circle_near_ink, episode, idle, press, wipe_nearest

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.base.task_env import TaskEnv
from contactsafe.tasks.wiping.config import RewardConfig, WipingConfig
from contactsafe.tasks.wiping.step import REWARD_TERMS
from contactsafe.tasks.wiping.tasks import WipingTasks

TASK = WipingConfig()
REWARD = TASK.reward
STEPS = round(TASK.episode_s * 60)
BOARD_EDGE_M = 2 * TASK.action.reach


@pytest.fixture(scope="module")
def finished():
    """Returns, tasks and terms of boards wiped by a script."""
    return episode(TASK, wipe_nearest, n=4)


def test_terms_sum_to_the_reward_and_each_is_in_info():
    env = TaskEnv("wiping", TASK)
    env.reset(seed=0)
    for action in np.random.default_rng(0).uniform(-1, 1, (40, 18)):
        _, reward, _, _, info = env.step(action)
        assert reward == pytest.approx(sum(info[f"reward_{name}"] for name in REWARD_TERMS), abs=1e-12)


def test_a_step_in_the_air_costs_time_and_pays_approach_only():
    tasks = WipingTasks(TASK, seed=0)
    drawing = np.zeros((50, 50))
    drawing[25, 45] = 1
    tasks.reset(0, np.random.default_rng(0), drawing=drawing, start=(0.5, 0.0, 0.06))
    action = np.zeros((1, 18))
    action[0, 1] = 1.0
    for _ in range(10):
        before = tasks.tasks["distance"][0]
        tasks.step(action)
        info = tasks.info()
        nearer = before - tasks.tasks["distance"][0]
        assert info["reward_approach"][0] == pytest.approx(REWARD.approach * nearer)
        assert tasks.reward[0] == pytest.approx(REWARD.time + REWARD.approach * nearer)
    assert nearer > 0.001


def test_the_ink_is_paid_once_in_proportion_and_done_once(finished):
    _, tasks, terms = finished
    assert tasks.tasks["success"].all()
    assert_allclose(terms[:, :, 0].sum(axis=0), REWARD.ink, rtol=2 * TASK.clean_fraction)
    for i in range(4):
        first = int(np.argmax(terms[:, i, 1] > 0))
        assert terms[first, i, 1] == REWARD.done
        assert not terms[:first, i, 1].any()


def test_a_hard_press_costs_more_than_contact_pays():
    _, tasks, terms = episode(TASK, lambda t, s: press(t, s, depth=TASK.action.press), n=1, steps=90)
    force = tasks.tasks["force_peak"][0]
    excess = min(max(force / REWARD.gentle_n - 1, 0), 4)
    assert terms[-1, 0, 5] == pytest.approx(REWARD.force * excess)
    assert terms[:, 0, 5].min() >= 4 * REWARD.force


def test_nothing_that_leaves_the_ink_can_pay_what_finishing_at_the_last_moment_pays():
    """Bounds by the configuration: approach is a difference, contact is less than time takes."""
    latest = REWARD.ink * (1 - TASK.clean_fraction) + REWARD.done + STEPS * REWARD.time
    hovering = STEPS * REWARD.time
    pressing = STEPS * (REWARD.time + REWARD.contact)
    circling = REWARD.approach * np.hypot(BOARD_EDGE_M, BOARD_EDGE_M) + STEPS * REWARD.time
    assert max(hovering, pressing, circling) < 0.0 < latest


def test_stopping_short_pays_less_than_finishing_whatever_is_left():
    """From any board, one more step that cleans it beats resting on it, in contact, until time is up."""
    for left in np.linspace(TASK.clean_fraction, 1.0, 20):
        for steps_left in (1, 10, STEPS):
            finishing = REWARD.ink * left + REWARD.done + REWARD.time
            resting = steps_left * (REWARD.contact + REWARD.time)
            assert finishing > resting


@pytest.mark.parametrize("script", [idle, press, circle_near_ink])
def test_finishing_pays_best(finished, script):
    returns, tasks, _ = episode(TASK, script, n=4, steps=300)
    assert not tasks.tasks["success"].any()
    # No policy step without ink wiped pays: the rest of the episode would only cost more.
    assert returns.max() < 5.0
    assert finished[0].min() > 2.0 * 5.0


def test_a_script_wipes_within_a_third_of_the_time_under_40_n(finished):
    """So the task can be done, with the actions and forces that a policy has."""
    _, _, terms = finished
    assert len(terms) < STEPS / 3
    assert terms[:, :, 5].min() > 3 * REWARD.force  # landing: under 40 N


def test_contact_that_outpays_time_is_refused():
    with pytest.raises(InvalidInputError) as caught:
        RewardConfig(contact=0.01, time=-0.01)
    assert str(caught.value) == (
        "reward contact 0.01 + time -0.01 ≥ 0 pays for never finishing; keep contact below 0.01"
    )
