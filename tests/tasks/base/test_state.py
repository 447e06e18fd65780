"""An environment given a state another had goes on as that did, new episodes and all."""

import gymnasium
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import contactsafe  # noqa: F401 -- registers the tasks
from contactsafe.core.errors import InvalidInputError


def course(env, steps, seed):
    """Step with random actions; everything the environment says."""
    rng = np.random.default_rng(seed)
    said = []
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(rng.uniform(-1, 1, (3, 18)))
        numbers = {key: value for key, value in info.items() if not key.startswith(("final", "_"))}
        said.append([*observation.values(), reward, terminated, truncated, *numbers.values()])
    return [np.array(column) for column in zip(*said, strict=True)]


def test_a_new_environment_goes_on_as_the_old_one_did(name, short, envs):
    other = gymnasium.make_vec(name, num_envs=3, config=short)
    envs.reset(seed=4)
    course(envs, 9, 0)
    state = envs.unwrapped.state_dict()
    before = course(envs, 17, 1)
    other.unwrapped.load_state_dict(state)
    after = course(other, 17, 1)
    truncated = before[len(envs.single_observation_space) + 2]
    assert truncated.sum() == 3 * 3
    for a, b in zip(before, after, strict=True):
        assert_array_equal(a, b)
    other.close()


def test_a_state_of_another_number_of_environments_is_refused_and_nothing_changed(name, short, envs):
    fewer = gymnasium.make_vec(name, num_envs=2, config=short)
    fewer.reset(seed=1)
    envs.reset(seed=4)
    before = envs.unwrapped.state_dict()
    with pytest.raises(InvalidInputError, match="start anew"):
        envs.unwrapped.load_state_dict(fewer.unwrapped.state_dict())
    np.testing.assert_equal(envs.unwrapped.state_dict(), before)
    fewer.close()
