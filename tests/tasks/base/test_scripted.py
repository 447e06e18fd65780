"""Actions at random: allowed, and the same again from the same seed."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.action_config import ACTION_SIZE
from contactsafe.tasks import make_vec, task_by_name
from contactsafe.tasks.base.scripted import RANDOM, hold_still


def policy(seed, num_envs=3):
    return RANDOM["random"](None, SimpleNamespace(num_envs=num_envs), seed)


@pytest.mark.parametrize("num_envs", [1, 8])
def test_actions_are_allowed_and_reach_everywhere(num_envs):
    acting = policy(0, num_envs)
    actions = np.array([acting.act({}) for _ in range(500)])
    assert actions.shape == (500, num_envs, ACTION_SIZE)
    assert actions.dtype == np.float32
    assert np.abs(actions).max() <= 1.0
    assert (actions.min(axis=(0, 1)) < -0.9).all()
    assert (actions.max(axis=(0, 1)) > 0.9).all()


def test_the_same_seed_and_a_copy_act_alike_and_another_does_not():
    one, same, other = policy(5), policy(5), policy(6)
    first = one.act({})
    np.testing.assert_array_equal(first, same.act({}))
    assert not np.array_equal(first, other.act({}))
    np.testing.assert_array_equal(copy.copy(one).act({}), one.act({}))


@pytest.mark.parametrize("task", ["wiping", "insertion"])
def test_holding_still_changes_no_target_of_any_task(task):
    env = make_vec(task, 2)
    observation, _ = env.reset(seed=0)
    assert not hold_still(observation).any()
    assert hold_still(observation).shape == env.action_space.shape
    env.close()


def test_a_script_of_a_name_that_only_another_task_has_is_refused():
    with pytest.raises(InvalidInputError) as error:
        task_by_name("insertion").scripted_policy("raster", None, None, 0)
    assert str(error.value) == ("scripted policy 'raster' is unknown; choose one of spiral, straight-down, random")
