"""Gymnasium's rules, single and vector: spaces, seeds, resets in the same step."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_array_equal

import contactsafe  # noqa: F401 -- registers the task
from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.base.environment import TaskEnv, TaskVectorEnv
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.step import REWARD_TERMS

NAME = "contactsafe/Wiping-v0"
SHORT = WipingConfig(episode_s=0.1)
"""Six policy steps."""


@pytest.fixture(scope="module")
def env():
    return gymnasium.make(NAME, config=SHORT)


@pytest.fixture
def envs():
    made = gymnasium.make_vec(NAME, num_envs=3, config=SHORT)
    yield made
    made.close()


def same(a, b):
    return all(np.array_equal(a[key], b[key]) for key in a)


def test_gymnasiums_checker_passes():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(gymnasium.make(NAME, config=SHORT, render_mode="rgb_array").unwrapped)
    told = [str(warning.message) for warning in caught]
    # A pose has no bound worth a promise; that is all it may remark on.
    assert all("minimum value is -infinity" in text or "maximum value is infinity" in text for text in told), told


def test_spaces(env, envs):
    assert env.observation_space["pose"].shape == (6,)
    assert env.observation_space["mask"].shape == (128, 128, 1)
    assert env.action_space.shape == (18,)
    assert envs.single_observation_space == env.observation_space
    assert envs.single_action_space == env.action_space
    observation, info = envs.reset(seed=0)
    assert observation in envs.observation_space
    assert envs.action_space.shape == (3, 18)
    assert_array_equal(info["ink_left"], 1.0)
    observation, reward, terminated, truncated, info = envs.step(envs.action_space.sample())
    assert observation in envs.observation_space
    assert reward.shape == terminated.shape == truncated.shape == (3,)
    for name in REWARD_TERMS:
        assert info[f"reward_{name}"].shape == (3,)


def test_make_vec_steps_natively(envs):
    assert isinstance(envs.unwrapped, TaskVectorEnv)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP


def test_a_seed_gives_an_episode_again(env):
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (5, 18)).astype(np.float32)
    runs = []
    for seed in (7, 7, 8):
        observations = [env.reset(seed=seed)[0]] + [env.step(action)[0] for action in actions]
        runs.append(observations)
    assert all(same(a, b) for a, b in zip(runs[0], runs[1], strict=True))
    assert not same(runs[0][0], runs[2][0])


def test_without_a_seed_the_next_episode_is_another(env):
    first, _ = env.reset(seed=7)
    second, _ = env.reset()
    assert not same(first, second)


def test_environment_i_is_the_single_one_seeded_with_seed_plus_i(env, envs):
    """Boards and starts; the sensors' noise comes from another stream."""
    observation, _ = envs.reset(seed=20)
    for i in range(3):
        alone, _ = env.reset(seed=20 + i)
        assert_array_equal(observation["mask"][i], alone["mask"])
        assert_array_equal(observation["pose"][i], alone["pose"])


def test_seeds_may_be_listed(envs):
    first, _ = envs.reset(seed=[5, 9, 5])
    assert same({k: v[0] for k, v in first.items()}, {k: v[2] for k, v in first.items()})
    with pytest.raises(InvalidInputError) as caught:
        envs.unwrapped.reset(seed=[1, 2])
    assert str(caught.value) == "2 seeds for 3 environments; give one each"


def test_an_episode_that_ends_begins_anew_in_the_same_step(envs):
    envs.reset(seed=0)
    idle = np.zeros((3, 18), np.float32)
    for _ in range(5):
        before, _, terminated, truncated, info = envs.step(idle)
        assert not (terminated | truncated).any()
        assert "final_obs" not in info
    observation, _, terminated, truncated, info = envs.step(idle)
    assert truncated.all()
    assert not terminated.any()
    assert_array_equal(info["_final_obs"], True)
    assert_array_equal(info["_final_info"], True)
    assert_array_equal(info["ink_left"], 1.0)
    for i in range(3):
        assert_array_equal(info["final_obs"][i]["mask"], before["mask"][i])
        assert not np.array_equal(info["final_obs"][i]["mask"], observation["mask"][i])
    for name in (*(f"reward_{term}" for term in REWARD_TERMS), "is_success", "tool_force_n"):
        assert_array_equal(info["final_info"][f"_{name}"], True)
        assert_array_equal(info["final_info"][name], info[name])
    _, _, terminated, truncated, info = envs.step(idle)
    assert not truncated.any()
    assert "final_info" not in info


def test_only_what_ended_is_marked(envs):
    envs.reset(seed=0)
    tasks = envs.unwrapped.tasks
    tasks.tasks["steps"][1] = tasks.step_limit - 1
    _, _, _, truncated, info = envs.step(np.zeros((3, 18), np.float32))
    assert_array_equal(truncated, (False, True, False))
    assert_array_equal(info["_final_obs"], truncated)
    assert_array_equal(info["final_info"]["_ink_left"], truncated)
    assert info["final_obs"][0] is None
    assert_array_equal(info["_is_success"], True)
    assert tasks.tasks["steps"].tolist() == [1, 0, 1]


def test_a_drawing_of_ones_own(env):
    drawing = np.zeros((10, 10))
    drawing[2:4, 5] = 1
    _, info = env.reset(seed=0, options={"drawing": drawing})
    assert info["ink_left"] == 1.0
    assert env.unwrapped.tasks.worlds.ink_cells()[0] == 2 * 15 * 15
    with pytest.raises(InvalidInputError, match=r"^drawing has shape \(2, 3\); give a square image"):
        env.reset(options={"drawing": np.ones((2, 3))})


def test_observation_is_a_copy(env):
    first, _ = env.reset(seed=1)
    kept = {key: value.copy() for key, value in first.items()}
    env.step(np.ones(18, np.float32))
    assert same(first, kept)


def test_rendering_is_the_mask_enlarged():
    env = TaskEnv("wiping", SHORT, render_mode="rgb_array")
    observation, _ = env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (512, 512, 3)
    assert_array_equal(picture[::4, ::4, 0], observation["mask"][..., 0])
    assert TaskEnv("wiping", SHORT).render() is None


@pytest.mark.parametrize(
    ("action", "text"),
    [
        (np.full(18, np.nan), "actions hold a number that is not finite; every action must be in [-1, 1]"),
        (np.zeros(17), "actions has shape (1, 17); give 1 × 18 numbers"),
        ("left", "actions is ndarray, not numbers; give 1 × 18 numbers"),
    ],
)
def test_bad_actions_are_refused_and_change_nothing(env, action, text):
    env.reset(seed=0)
    before = env.unwrapped.tasks.worlds.controllers.copy()
    with pytest.raises(InvalidInputError) as caught:
        env.unwrapped.step(action)
    assert str(caught.value) == text
    assert_array_equal(env.unwrapped.tasks.worlds.controllers["target"], before["target"])


@pytest.mark.parametrize("count", [0, -1, 1.5, "3", None])
def test_no_number_of_environments_is_refused(count):
    with pytest.raises(InvalidInputError) as caught:
        TaskVectorEnv(count)
    assert str(caught.value) == f"num_envs = {count!r}; give a whole number from 1 on"


@pytest.mark.parametrize("seconds", [-1.0, 0.0, 0.001, 1e9, np.inf, np.nan, "long"])
def test_no_length_of_an_episode_is_refused(seconds):
    with pytest.raises(InvalidInputError, match="episode_s"):
        WipingConfig(episode_s=seconds)
