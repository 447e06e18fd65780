"""The reward in the paper's words: for ink, for the end, for contact below 40 N, for being near; nothing for time."""

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.wiping.config import RewardConfig, WipingConfig
from contactsafe.tasks.wiping.step import REWARD_TERMS
from contactsafe.tasks.wiping.tasks import WipingTasks

PAPER = RewardConfig.as_paper()


@pytest.fixture
def tasks():
    return WipingTasks(WipingConfig(controller="vices", reward=PAPER), seed=0)


def begin(tasks, start):
    """Begin with ink in the middle of the board alone."""
    drawing = np.zeros((21, 21), np.uint8)
    drawing[10, 10] = 1
    tasks.reset(0, np.random.default_rng(0), start=start, drawing=drawing)


def terms(tasks):
    return dict(zip(REWARD_TERMS, tasks.tasks["reward"][0].tolist(), strict=True))


def test_near_ink_pays_more_than_far_from_it_and_time_takes_nothing(tasks):
    paid = []
    x, y, z = tasks.config.board.centre
    for away in (0.0, 0.05, 0.1):
        begin(tasks, (x + away, y, z + 0.06))
        tasks.step(np.zeros((1, 18)))
        now = terms(tasks)
        paid.append(now["approach"])
        distance = float(tasks.tasks["distance"][0])
        assert now["approach"] == pytest.approx(PAPER.nearness * (1.0 - distance / PAPER.nearness_m), rel=1e-12)
        assert (now["time"], now["force"], now["contact"], now["ink"]) == (0.0, 0.0, 0.0, 0.0)
    assert paid == sorted(paid, reverse=True)
    assert paid[0] > paid[-1] > 0.0


def test_staying_is_worth_less_than_the_end():
    discount = 0.995
    assert (PAPER.contact + PAPER.nearness) / (1.0 - discount) < PAPER.done


def test_a_reward_that_pays_for_staying_is_refused_unless_asked_for():
    with pytest.raises(InvalidInputError, match="pays for never finishing"):
        RewardConfig(nearness=0.005)
    RewardConfig(nearness=0.005, staying_pays=True)


def test_nearness_has_a_range():
    with pytest.raises(InvalidInputError) as error:
        RewardConfig(nearness_m=0.0)
    assert str(error.value) == "reward nearness_m = 0.0; give more than 0 m"
