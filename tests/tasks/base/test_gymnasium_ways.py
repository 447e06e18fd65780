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
from tests.tasks.base.observations import drawn, row, same

import contactsafe  # noqa: F401 -- registers the tasks
from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks import task_by_name
from contactsafe.tasks.base.task_env import TaskEnv
from contactsafe.tasks.base.task_vector_env import TaskVectorEnv
from contactsafe.tasks.base.tasks import Tasks

IDLE = np.zeros(18, np.float32)


@pytest.fixture
def fresh(task, short):
    """One environment that was never reset."""
    return TaskEnv(task, short)


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


def test_limits_of_an_episode_are_those_asked_for(task, name, short):
    assert steps_until_cut(gymnasium.make(name, config=short)) == 6
    assert steps_until_cut(gymnasium.make(name, max_episode_steps=5)) == 5
    for mode in ("vector_entry_point", "sync"):
        envs = gymnasium.make_vec(name, num_envs=2, vectorization_mode=mode, render_mode=None, max_episode_steps=5)
        assert steps_until_cut(envs) == 5
        envs.close()
    assert steps_until_cut(TaskVectorEnv(2, task, short, max_episode_steps=9)) == 9


def test_spec_says_how_many_steps_an_episode_has(task, name, short):
    usual = round(60 * task_by_name(task).simulation.config_type().episode_s)
    assert gymnasium.make(name).spec.max_episode_steps == usual
    assert gymnasium.make(name, config=short).spec.max_episode_steps == 6
    assert gymnasium.make(name, max_episode_steps=5).spec.max_episode_steps == 5
    assert gymnasium.make_vec(name, num_envs=2, config=short).spec.max_episode_steps == 6
    assert gymnasium.make_vec(name, num_envs=2, max_episode_steps=5).spec.max_episode_steps == 5
    assert steps_until_cut(gymnasium.make(gymnasium.make(name, config=short).spec)) == 6
    assert gymnasium.spec(name).max_episode_steps is None, "one environment's limit must not become that of the next"


def test_a_step_before_the_first_reset_is_told_as_gymnasium_tells_it(fresh, envs, name):
    for made, action in ((fresh, IDLE), (envs, np.zeros((3, 18), np.float32)), (gymnasium.make(name), IDLE)):
        with pytest.raises(ResetNeeded):
            made.step(action)
    text = refusal(envs.unwrapped.step, np.zeros((3, 18)), error=ResetNeeded)
    assert text == "`step` was called before `reset`; call `reset` first"


def test_closing_twice_does_no_harm_and_what_is_closed_says_so(fresh, task, short):
    for made in (fresh, TaskVectorEnv(2, task, short)):
        made.reset(seed=0)
        made.close()
        made.close()
        action = np.zeros(made.action_space.shape, np.float32)
        text = refusal(made.step, action, error=ClosedEnvironmentError)
        assert text == "`step` was called after `close`; make the environment anew"
        assert "`reset` was called after `close`" in refusal(made.reset, error=ClosedEnvironmentError)


@pytest.mark.parametrize("make", [TaskEnv, TaskVectorEnv])
def test_what_it_cannot_be_made_with_is_told(make, task):
    kind = task_by_name(task).simulation.config_type
    assert "unexpected keyword argument 'board'" in refusal(make, task=task, board=1, error=TypeError)
    assert refusal(make, task=task, config={"episode_s": 1.0}) == (
        f"config is dict; give a {kind.__name__} ({kind.__module__}), such as {kind.__name__}(episode_s=10.0)"
    )
    assert refusal(make, task=task, render_mode="human") == "render_mode = 'human'; choose rgb_array, or None"
    unseen = type("Unseen", (task_by_name(task).simulation,), {"picture": Tasks.picture})
    text = f"render_mode = 'rgb_array'; task '{task}' has no picture, give None"
    assert refusal(make, task=unseen, render_mode="rgb_array") == text
    text = "max_episode_steps = 0; give 1 or more, or None for the config's"
    assert refusal(make, task=task, max_episode_steps=0) == text
    assert refusal(make, task=task, engine="steam") == "engine = 'steam'; choose mujoco or pybullet"


@pytest.mark.parametrize("count", [0, -1, 1.5, "3", None])
def test_no_number_of_environments_is_refused(count, task):
    assert refusal(TaskVectorEnv, count, task) == f"num_envs = {count!r}; give a whole number from 1 on"


@pytest.mark.parametrize("seconds", [-1.0, 0.0, 0.001, 1e9, np.inf, np.nan, "long"])
def test_no_length_of_an_episode_is_refused(seconds, task):
    assert "episode_s" in refusal(task_by_name(task).simulation.config_type, episode_s=seconds)


def test_unknown_keywords_name_the_environment_when_made_by_its_name(name):
    assert name in refusal(gymnasium.make, name, board=1, error=TypeError)
    assert "board" in refusal(gymnasium.make_vec, name, num_envs=2, board=1, error=TypeError)


def test_unknown_options_of_a_reset_are_told(fresh, envs, task):
    known = task_by_name(task).simulation.reset_options
    text = f"reset options hold drawin; known are {', '.join(known) or 'none'}; leave others out"
    assert refusal(fresh.reset, options={"drawin": 1}) == text
    text = f"reset options hold reset; known are {', '.join([*known, 'reset_mask'])}; leave others out"
    assert refusal(envs.reset, options={"reset": 1}) == text
    fresh.reset(options={})
    fresh.reset(options=None)


@pytest.mark.parametrize("seed", [np.int64(7), np.uint8(7), 7])
def test_seeds_may_be_numpys_whole_numbers(env, envs, seed):
    first = env.reset(seed=7)[0]
    assert same(env.unwrapped.reset(seed=seed)[0], first)
    assert same(drawn(row(envs.reset(seed=seed)[0], 0)), drawn(first))


@pytest.mark.parametrize("of", [list, tuple, np.array])
def test_seeds_of_a_vector_environment_come_in_any_sequence(envs, of):
    seen = drawn(envs.reset(seed=of([5, 9, 5]))[0])
    assert same(row(seen, 0), row(seen, 2))
    assert not same(row(seen, 0), row(seen, 1))


def test_seeds_for_another_number_of_environments_are_refused(envs):
    assert refusal(envs.unwrapped.reset, seed=[1, 2]) == "2 seeds for 3 environments; give one each"


@pytest.mark.parametrize("seed", [-1, 1.5, "seven", True])
def test_what_is_no_seed_is_told(fresh, envs, seed):
    text = f"seed = {seed!r}; give a whole number, 0 or more, or None"
    assert refusal(fresh.reset, seed=seed) == text
    assert refusal(envs.reset, seed=[seed] * 3) == text


def test_generators_are_gymnasiums(fresh, envs):
    fresh.reset(seed=3)
    envs.reset(seed=3)
    assert fresh.np_random_seed == envs.unwrapped.np_random_seed == 3
    assert isinstance(fresh.np_random, np.random.Generator)
    assert isinstance(envs.unwrapped.np_random, np.random.Generator)


def test_a_reset_mask_begins_new_episodes_where_it_is_true_and_nowhere_else(envs):
    envs.reset(seed=0)
    seen = envs.step(np.ones((3, 18), np.float32))[0]
    mask = np.array([False, True, False])
    after, info = envs.reset(options={"reset_mask": mask})
    for said in envs.unwrapped.tasks.start_info:
        assert_array_equal(info[f"_{said}"], mask)
    for key, value in seen.items():
        assert_array_equal(after[key][~mask], value[~mask])
    assert not same(row(after, 1), row(seen, 1))
    assert envs.unwrapped.tasks.tasks["steps"].tolist() == [1, 0, 1]


@pytest.mark.parametrize("seed", [4, [0, 5, 0]])
def test_a_reset_mask_seeds_those_it_chooses(envs, env, seed):
    envs.reset(seed=0)
    after, _ = envs.reset(seed=seed, options={"reset_mask": np.array([False, True, False])})
    assert same(drawn(row(after, 1)), drawn(env.reset(seed=5)[0]))


@pytest.mark.parametrize("mask", [np.zeros(3, bool), np.ones(2, bool), np.ones(3), [1, 0, 0]])
def test_a_reset_mask_that_means_nothing_is_told(envs, mask):
    envs.reset(seed=0)
    mask_array = np.asarray(mask)
    assert refusal(envs.reset, options={"reset_mask": mask}) == (
        f"reset_mask is {mask_array.dtype} of shape {mask_array.shape}, {np.count_nonzero(mask_array)} of it true; "
        "give bool (3,), one or more of it true"
    )


def test_a_reset_mask_before_all_were_reset_is_told(envs):
    text = refusal(envs.reset, options={"reset_mask": np.array([True, False, False])}, error=ResetNeeded)
    assert text == "`reset` with a reset_mask was called before all had been reset; call `reset` first"


def test_a_vector_environment_steps_natively_and_says_when_it_resets(envs):
    assert isinstance(envs.unwrapped, TaskVectorEnv)
    assert envs.unwrapped.autoreset_mode is envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert envs.render() is None


def test_gymnasiums_vector_wrappers_go_around_it(name, short):
    envs = gymnasium.make_vec(name, num_envs=2, config=short)
    envs = RecordEpisodeStatistics(
        TransformReward(RescaleAction(envs, np.float32(-2.0), np.float32(2.0)), lambda reward: 2.0 * reward)
    )
    envs.reset(seed=0)
    for _ in range(6):
        *_, info = envs.step(np.zeros((2, 18), np.float32))
    assert_array_equal(info["episode"]["l"], 6)
    envs.close()


def test_a_vector_environment_of_one_kind_is_the_other(envs, name, short):
    """Episodes and starts are those of the environment that Gymnasium steps one after the other."""
    sync = gymnasium.make_vec(name, num_envs=3, vectorization_mode="sync", config=short)
    assert same(drawn(envs.reset(seed=11)[0]), drawn(sync.reset(seed=11)[0]))
    sync.close()


def test_the_checker_passes_on_a_copy_too(fresh):
    with pytest.warns(UserWarning, match="infinity"):
        check_env(copy.deepcopy(fresh), skip_render_check=True)
