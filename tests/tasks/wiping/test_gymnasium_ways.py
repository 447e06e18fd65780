"""What Gymnasium's other environments take and refuse, these do too: keywords, order of calls, seeds, limits."""

import copy

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics, RescaleAction, TransformReward
from numpy.testing import assert_array_equal

import contactsafe  # noqa: F401 -- registers the task
from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.base.environment import TaskEnv, TaskVectorEnv
from contactsafe.tasks.wiping.config import WipingConfig

NAME = "contactsafe/Wiping-v0"
SHORT = WipingConfig(episode_s=0.1)
"""Six policy steps."""

IDLE = np.zeros(18, np.float32)


@pytest.fixture
def env():
    return TaskEnv("wiping", SHORT)


@pytest.fixture
def envs():
    made = TaskVectorEnv(3, "wiping", SHORT)
    yield made
    made.close()


def steps_until_cut(env):
    env.reset(seed=0)
    for step in range(1, 20):
        *_, truncated, _ = env.step(np.zeros(env.action_space.shape, np.float32))
        if np.all(truncated):
            return step
    return None


def refusal(call, *arguments, error=InvalidInputError, **named):
    with pytest.raises(error) as caught:
        call(*arguments, **named)
    return str(caught.value)


def test_limits_of_an_episode_are_those_asked_for():
    assert steps_until_cut(gymnasium.make(NAME, config=SHORT)) == 6
    assert steps_until_cut(gymnasium.make(NAME, max_episode_steps=5)) == 5
    for mode in ("vector_entry_point", "sync"):
        envs = gymnasium.make_vec(NAME, num_envs=2, vectorization_mode=mode, render_mode=None, max_episode_steps=5)
        assert steps_until_cut(envs) == 5
        envs.close()
    assert steps_until_cut(TaskVectorEnv(2, "wiping", SHORT, max_episode_steps=9)) == 9


def test_spec_says_how_many_steps_an_episode_has():
    assert gymnasium.make(NAME).spec.max_episode_steps == 1200
    assert gymnasium.make(NAME, config=SHORT).spec.max_episode_steps == 6
    assert gymnasium.make(NAME, max_episode_steps=5).spec.max_episode_steps == 5
    assert gymnasium.make_vec(NAME, num_envs=2, config=SHORT).spec.max_episode_steps == 6
    assert gymnasium.make_vec(NAME, num_envs=2, max_episode_steps=5).spec.max_episode_steps == 5
    assert steps_until_cut(gymnasium.make(gymnasium.make(NAME, config=SHORT).spec)) == 6
    assert gymnasium.spec(NAME).max_episode_steps is None, "one environment's limit must not become that of the next"


def test_a_step_before_the_first_reset_is_told_as_gymnasium_tells_it(env, envs):
    for made, action in ((env, IDLE), (envs, np.zeros((3, 18), np.float32)), (gymnasium.make(NAME), IDLE)):
        with pytest.raises(ResetNeeded):
            made.step(action)
    text = refusal(envs.step, np.zeros((3, 18)), error=ResetNeeded)
    assert text == "`step` was called before `reset`; call `reset` first"


def test_closing_twice_does_no_harm_and_what_is_closed_says_so(env):
    envs = TaskVectorEnv(2, "wiping", SHORT)
    for made in (env, envs):
        made.reset(seed=0)
        made.close()
        made.close()
        action = np.zeros(made.action_space.shape, np.float32)
        text = refusal(made.step, action, error=ClosedEnvironmentError)
        assert text == "`step` was called after `close`; make the environment anew"
        assert "`reset` was called after `close`" in refusal(made.reset, error=ClosedEnvironmentError)


@pytest.mark.parametrize("make", [TaskEnv, TaskVectorEnv])
def test_what_it_cannot_be_made_with_is_told(make):
    assert "unexpected keyword argument 'board'" in refusal(make, board=1, error=TypeError)
    assert refusal(make, config={"episode_s": 1.0}) == (
        "config is dict; give a WipingConfig (contactsafe.tasks.wiping.config), such as WipingConfig(episode_s=10.0)"
    )
    assert refusal(make, render_mode="human") == "render_mode = 'human'; choose rgb_array, or None"
    text = "max_episode_steps = 0; give 1 or more, or None for the config's"
    assert refusal(make, max_episode_steps=0) == text


def test_unknown_keywords_name_the_environment_when_made_by_its_name():
    assert NAME in refusal(gymnasium.make, NAME, board=1, error=TypeError)
    assert "board" in refusal(gymnasium.make_vec, NAME, num_envs=2, board=1, error=TypeError)


def test_unknown_options_of_a_reset_are_told(env, envs):
    text = "reset options hold drawin; known are drawing; leave others out"
    assert refusal(env.reset, options={"drawin": 1}) == text
    text = "reset options hold reset; known are drawing, reset_mask; leave others out"
    assert refusal(envs.reset, options={"reset": 1}) == text
    env.reset(options={})
    env.reset(options=None)


@pytest.mark.parametrize("seed", [np.int64(7), np.uint8(7), 7])
def test_seeds_may_be_numpys_whole_numbers(env, envs, seed):
    mask = env.reset(seed=7)[0]["mask"]
    assert_array_equal(env.reset(seed=seed)[0]["mask"], mask)
    assert_array_equal(envs.reset(seed=seed)[0]["mask"][0], mask)


@pytest.mark.parametrize("of", [list, tuple, np.array])
def test_seeds_of_a_vector_environment_come_in_any_sequence(envs, of):
    seen, _ = envs.reset(seed=of([5, 9, 5]))
    assert_array_equal(seen["mask"][0], seen["mask"][2])
    assert not np.array_equal(seen["mask"][0], seen["mask"][1])


@pytest.mark.parametrize("seed", [-1, 1.5, "seven", True])
def test_what_is_no_seed_is_told(env, envs, seed):
    text = f"seed = {seed!r}; give a whole number, 0 or more, or None"
    assert refusal(env.reset, seed=seed) == text
    assert refusal(envs.reset, seed=[seed] * 3) == text


def test_generators_are_gymnasiums(env, envs):
    env.reset(seed=3)
    envs.reset(seed=3)
    assert env.np_random_seed == envs.np_random_seed == 3
    assert isinstance(env.unwrapped.np_random, np.random.Generator)
    assert isinstance(envs.unwrapped.np_random, np.random.Generator)


def test_a_reset_mask_begins_new_episodes_where_it_is_true_and_nowhere_else(envs):
    envs.reset(seed=0)
    seen = envs.step(np.ones((3, 18), np.float32))[0]
    mask = np.array([False, True, False])
    after, info = envs.reset(options={"reset_mask": mask})
    assert_array_equal(info["_ink_left"], mask)
    for name, value in seen.items():
        assert_array_equal(after[name][~mask], value[~mask])
    assert not np.array_equal(after["mask"][1], seen["mask"][1])
    assert envs.tasks.tasks["steps"].tolist() == [1, 0, 1]


@pytest.mark.parametrize("seed", [4, [0, 5, 0]])
def test_a_reset_mask_seeds_those_it_chooses(envs, seed):
    envs.reset(seed=0)
    after, _ = envs.reset(seed=seed, options={"reset_mask": np.array([False, True, False])})
    alone, _ = TaskEnv("wiping", SHORT).reset(seed=5)
    assert_array_equal(after["mask"][1], alone["mask"])


@pytest.mark.parametrize("mask", [np.zeros(3, bool), np.ones(2, bool), np.ones(3), [1, 0, 0]])
def test_a_reset_mask_that_means_nothing_is_told(envs, mask):
    envs.reset(seed=0)
    mask_array = np.asarray(mask)
    assert refusal(envs.reset, options={"reset_mask": mask}) == (
        f"reset_mask is {mask_array.dtype} of shape {mask_array.shape}, {np.count_nonzero(mask_array)} of it true; "
        "give bool (3,), one or more of it true"
    )


def test_a_vector_environment_says_when_it_resets_and_renders(envs):
    assert envs.autoreset_mode is envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert envs.render() is None
    drawn = TaskVectorEnv(2, "wiping", SHORT, render_mode="rgb_array")
    seen, _ = drawn.reset(seed=0)
    pictures = drawn.render()
    assert len(pictures) == 2
    assert_array_equal(pictures[1][::4, ::4, 0], seen["mask"][1, ..., 0])
    drawn.close()


def test_gymnasiums_vector_wrappers_go_around_it():
    envs = gymnasium.make_vec(NAME, num_envs=2, config=SHORT)
    envs = RecordEpisodeStatistics(
        TransformReward(RescaleAction(envs, np.float32(-2.0), np.float32(2.0)), lambda reward: 2.0 * reward)
    )
    envs.reset(seed=0)
    for _ in range(6):
        *_, info = envs.step(np.zeros((2, 18), np.float32))
    assert_array_equal(info["episode"]["l"], 6)
    envs.close()


def test_a_vector_environment_of_one_kind_is_the_other(envs):
    """Boards and starts are those of the environment that Gymnasium steps one after the other."""
    sync = gymnasium.make_vec(NAME, num_envs=3, vectorization_mode="sync", config=SHORT)
    ours, theirs = envs.reset(seed=11)[0], sync.reset(seed=11)[0]
    assert_array_equal(ours["mask"], theirs["mask"])
    sync.close()


def test_the_checker_passes_on_a_copy_too(env):
    with pytest.warns(UserWarning, match="infinity"):
        check_env(copy.deepcopy(env), skip_render_check=True)
