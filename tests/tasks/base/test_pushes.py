"""Somebody leans on the arm while it works: in turn, within the ranges, the same for the same seed."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import arm_from_description
from contactsafe.robot.franka import HAND
from contactsafe.robot.panda import PANDA
from contactsafe.tasks.base.pushes import Pushes, PushSchedule
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.tasks import WipingTasks

PUSHES = Pushes(force_n=(20.0, 25.0), lasting_s=(0.2, 0.4), pause_s=(0.1, 0.2), links=(4, 5))


def arm_of(n):
    """An arm of n joints, those of the Panda over again."""
    links, home = (2 * PANDA.links)[:n], (2 * PANDA.home)[:n]
    return arm_from_description(replace(PANDA, links=links, home=home), HAND)


def pushed(steps=120, seed=3):
    """Hold still for a while; return what was planned at each step, and how far the tool went, m."""
    tasks = WipingTasks(WipingConfig(controller="vices", pushes=PUSHES), 1, seed=0)
    tasks.reset(0, np.random.default_rng(seed), drawing=np.ones((2, 2)), start=(0.5, 0.0, 0.1))
    start, planned, displacement = tasks.tasks["pose"][0, :3].copy(), [], 0.0
    for _ in range(steps):
        push = tasks.worlds.records[0]["push"]
        plan = [int(push[name]) for name in ("body", "start", "stop")]
        planned.append((*plan, *push["force"]))
        tasks.step(np.zeros((1, 18)))
        displacement = max(displacement, float(np.linalg.norm(tasks.tasks["pose"][0, :3] - start)))
    return sorted(set(planned), key=lambda push: push[1]), displacement


def test_pushes_follow_one_another_within_their_ranges_and_move_the_arm():
    plans, displacement = pushed()
    assert len(plans) >= 3
    for (_, _, stop, *_), (_, start, *_) in itertools.pairwise(plans):
        assert start > stop
    for _, start, stop, *force in plans:
        assert 195 <= stop - start <= 405
        assert 20.0 <= np.linalg.norm(force) <= 25.0
    assert len({body for body, *_ in plans}) <= 2
    assert displacement > 0.003


def test_same_seed_same_pushes():
    assert_array_equal(pushed(60)[0], pushed(60)[0])
    assert pushed(60)[0] != pushed(60, seed=4)[0]


def test_pushes_that_cannot_be_are_refused():
    with pytest.raises(InvalidInputError) as error:
        Pushes(force_n=(30.0, 5.0))
    assert str(error.value) == "pushes force_n = (30.0, 5.0); give (low, high) with 0 ≤ low ≤ high"
    with pytest.raises(InvalidInputError) as error:
        Pushes(links=(0,))
    assert str(error.value) == "pushes links = (0,); give numbers from 1 on, or None for the middle ones"
    with pytest.raises(InvalidInputError) as error:
        Pushes(links=())
    assert str(error.value) == "pushes links = (); give numbers from 1 on, or None for the middle ones"


@pytest.mark.parametrize("n", range(1, 12))
def test_every_link_of_an_arm_of_any_number_of_joints_may_be_pushed_and_no_other(n):
    arm = arm_of(n)
    for link in range(1, n + 1):
        assert Pushes(links=(link,)).links_of(arm) == (link,)
    with pytest.raises(InvalidInputError, match=rf"arm 'panda' has {n}, give some of those$"):
        Pushes(links=(1, n + 1)).links_of(arm)
    chosen = Pushes().links_of(arm)
    assert chosen
    assert set(chosen) <= set(range(1, n + 1))


def test_the_eighth_link_of_nine_is_pushed():
    pushed_bodies = []
    worlds = SimpleNamespace(arm=arm_of(9), n=1, records=np.zeros(1, [("tick", int)]))
    worlds.push = lambda i, body, *rest: pushed_bodies.append(body)
    PushSchedule(worlds, Pushes(links=(8,))).begin(0, np.random.default_rng(0))
    assert pushed_bodies == ["link8"]
