"""What becomes of an episode that ends: Gymnasium's three autoreset modes."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_array_equal
from tests.tasks.base.observations import drawn, row, same

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.base.task_vector_env import TaskVectorEnv

IDLE = np.zeros((3, 18), np.float32)


@pytest.fixture
def envs_in(task, short):
    """Make three environments in a mode, the second of which ends with the next step, long before the others."""
    made = []

    def make(mode):
        envs = TaskVectorEnv(3, task, short, autoreset_mode=mode)
        made.append(envs)
        envs.reset(seed=0)
        envs.tasks.tasks["steps"][1] = envs.tasks.step_limit - 1
        return envs

    yield make
    for envs in made:
        envs.close()


def test_an_episode_that_ends_begins_anew_in_the_same_step(envs):
    envs.reset(seed=0)
    for _ in range(5):
        _, _, terminated, truncated, info = envs.step(IDLE)
        assert not (terminated | truncated).any()
        assert "final_obs" not in info
    observation, _, terminated, truncated, info = envs.step(IDLE)
    assert truncated.all()
    assert not terminated.any()
    assert_array_equal(info["_final_obs"], True)
    assert_array_equal(info["_final_info"], True)
    tasks = envs.unwrapped.tasks
    for said, value in tasks.start_info.items():
        assert_array_equal(info[said], value)
    for i in range(3):
        assert not same(drawn(info["final_obs"][i]), drawn(row(observation, i)))
    for name in (*(f"reward_{term}" for term in tasks.reward_terms), "is_success", "tool_force_n"):
        assert_array_equal(info["final_info"][f"_{name}"], True)
        assert info["final_info"][name].dtype == info[name].dtype
        assert not info[name].any()
        assert not info[f"_{name}"].any()
    _, _, terminated, truncated, info = envs.step(IDLE)
    assert not truncated.any()
    assert "final_info" not in info


def test_only_what_ended_is_marked(envs_in):
    envs = envs_in("same_step")
    _, _, _, truncated, info = envs.step(IDLE)
    assert_array_equal(truncated, (False, True, False))
    assert_array_equal(info["_final_obs"], truncated)
    assert_array_equal(info["final_info"]["_is_success"], truncated)
    assert info["final_obs"][0] is None
    assert_array_equal(info["_is_success"], ~truncated)
    assert envs.tasks.tasks["steps"].tolist() == [1, 0, 1]


def test_in_the_next_step_an_action_is_ignored_and_its_reward_nothing(envs_in):
    envs = envs_in(AutoresetMode.NEXT_STEP)
    last, _, _, truncated, info = envs.step(IDLE)
    assert_array_equal(truncated, (False, True, False))
    assert "final_obs" not in info
    observation, reward, terminated, truncated, _ = envs.step(np.ones((3, 18), np.float32))
    assert reward[1] == 0.0
    assert not (terminated | truncated).any()
    assert not same(drawn(row(last, 1)), drawn(row(observation, 1)))
    assert envs.tasks.tasks["steps"].tolist() == [2, 0, 2]


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_a_success_was_reported_again_by_the_step_that_reset_it(envs_in, mode):
    envs = envs_in(mode)
    finish_step = envs.tasks.finish_step

    def succeed_at_once(start, stop):
        finish_step(start, stop)
        envs.tasks.tasks["success"][start:stop] |= envs.tasks.tasks["steps"][start:stop] == envs.tasks.step_limit

    envs.tasks.finish_step = succeed_at_once
    successes = np.zeros(3, int)
    for _ in range(3):
        _, reward, terminated, _, info = envs.step(IDLE)
        successes += info["is_success"] + info.get("final_info", {"is_success": 0})["is_success"]
        begun = ~info["_is_success"]
        for name in (f"reward_{term}" for term in envs.tasks.reward_terms):
            assert_array_equal(info[f"_{name}"], ~begun)
            assert not info[name][begun].any()
        if mode is AutoresetMode.NEXT_STEP:
            assert not reward[begun].any()
            assert not terminated[begun].any()
    assert_array_equal(successes, (0, 1, 0))


def test_a_mode_decides_when_and_not_what(envs_in):
    """The episode that follows is the same in all modes."""
    following = []
    for mode in AutoresetMode:
        envs = envs_in(mode)
        observation = envs.step(IDLE)[0]
        if mode is AutoresetMode.NEXT_STEP:
            observation = envs.step(IDLE)[0]
        elif mode is AutoresetMode.DISABLED:
            observation, _ = envs.reset(options={"reset_mask": np.array([False, True, False])})
        following.append(drawn(row(observation, 1)))
    assert same(following[0], following[1])
    assert same(following[0], following[2])


def test_disabled_leaves_the_reset_to_the_caller(envs_in):
    envs = envs_in("disabled")
    *_, truncated, _ = envs.step(IDLE)
    with pytest.raises(ResetNeeded) as caught:
        envs.step(IDLE)
    assert str(caught.value) == "`step` was called while episode 1 is over; call `reset` with a reset_mask"
    envs.reset(options={"reset_mask": truncated})
    *_, truncated, _ = envs.step(IDLE)
    assert not truncated.any()
    assert envs.tasks.tasks["steps"].tolist() == [2, 1, 2]


@pytest.mark.parametrize("mode", AutoresetMode)
def test_the_mode_is_told_as_gymnasium_tells_it(mode, name, short):
    envs = gymnasium.make_vec(name, num_envs=2, config=short, autoreset_mode=mode)
    assert envs.metadata["autoreset_mode"] is mode
    envs.close()


def test_a_mode_that_there_is_not_is_told(task):
    with pytest.raises(InvalidInputError) as caught:
        TaskVectorEnv(2, task, autoreset_mode="later")
    assert str(caught.value) == "autoreset_mode = 'later'; choose one of NEXT_STEP, SAME_STEP, DISABLED"
