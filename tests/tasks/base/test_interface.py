"""Gymnasium's rules, single and vector: spaces, seeds, actions, copies of what is observed."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.testing import assert_array_equal
from tests.tasks.base.observations import drawn, row, same

import contactsafe  # noqa: F401 -- registers the tasks
from contactsafe.core.errors import InvalidInputError


def test_gymnasiums_checker_passes(name, short):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(gymnasium.make(name, config=short).unwrapped, skip_render_check=True)
    told = [str(warning.message) for warning in caught]
    # A pose has no bound worth a promise; that is all it may remark on.
    assert all("minimum value is -infinity" in text or "maximum value is infinity" in text for text in told), told


def test_spaces(env, envs):
    tasks = env.unwrapped.tasks
    vectors = {vector.name: (vector.size,) for vector in tasks.observation_vectors}
    spaces = {key: space.shape for key, space in env.observation_space.items()}
    assert spaces == vectors | {key: space.shape for key, space in tasks.own_spaces().items()}
    assert env.action_space.shape == (18,)
    assert envs.single_observation_space == env.observation_space
    assert envs.single_action_space == env.action_space
    observation, info = envs.reset(seed=0)
    assert observation in envs.observation_space
    assert envs.action_space.shape == (3, 18)
    for said, value in tasks.start_info.items():
        assert_array_equal(info[said], value)
    observation, reward, terminated, truncated, info = envs.step(envs.action_space.sample())
    assert observation in envs.observation_space
    assert reward.shape == terminated.shape == truncated.shape == (3,)
    terms = [info[f"reward_{term}"] for term in tasks.reward_terms]
    assert len(terms) > 0
    assert all(term.shape == (3,) for term in terms)
    np.testing.assert_allclose(reward, np.sum(terms, axis=0), atol=1e-12)


def test_a_seed_gives_an_episode_again(env):
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (5, 18)).astype(np.float32)
    runs = []
    for seed in (7, 7, 8):
        observations = [env.reset(seed=seed)[0]] + [env.step(action)[0] for action in actions]
        runs.append(observations)
    assert all(same(a, b) for a, b in zip(runs[0], runs[1], strict=True))
    assert not same(drawn(runs[0][0]), drawn(runs[2][0]))


def test_without_a_seed_the_next_episode_is_another(env):
    first, _ = env.reset(seed=7)
    second, _ = env.reset()
    assert not same(drawn(first), drawn(second))


def test_environment_i_is_the_single_one_seeded_with_seed_plus_i(env, envs):
    """Episodes and starts; the sensors' noise comes from another stream."""
    observation, _ = envs.reset(seed=20)
    for i in range(3):
        alone, _ = env.reset(seed=20 + i)
        assert same(drawn(row(observation, i)), drawn(alone))


def test_observation_is_a_copy(env):
    first, _ = env.reset(seed=1)
    kept = {key: value.copy() for key, value in first.items()}
    env.step(np.ones(18, np.float32))
    assert same(first, kept)


@pytest.mark.parametrize(
    ("action", "text"),
    [
        (
            np.full(18, np.nan),
            "actions hold a number that is not finite; give finite ones, of which those outside [-1, 1] are clipped",
        ),
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
