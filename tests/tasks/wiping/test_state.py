"""An environment given a state they had goes on as it did, new boards and all."""

import gymnasium
import numpy as np
from numpy.testing import assert_array_equal

import contactsafe  # noqa: F401 -- registers the task
from contactsafe.tasks.wiping.config import WipingConfig

SHORT = WipingConfig(episode_s=0.15)
"""Nine policy steps."""


def course(env, steps, seed):
    """Step with random actions; everything the environment says."""
    rng = np.random.default_rng(seed)
    said = []
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(rng.uniform(-1, 1, (3, 18)))
        numbers = {key: value for key, value in info.items() if not key.startswith(("final", "_"))}
        said.append([observation["pose"], observation["mask"], reward, terminated, truncated, *numbers.values()])
    return [np.array(column) for column in zip(*said, strict=True)]


def test_a_new_environment_goes_on_as_the_old_one_did():
    make = lambda: gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=3, config=SHORT)  # noqa: E731
    first, second = make(), make()
    first.reset(seed=4)
    course(first, 13, 0)
    state = first.unwrapped.state_dict()
    before = course(first, 25, 1)
    second.unwrapped.load_state_dict(state)
    after = course(second, 25, 1)
    assert before[4].sum() == 3 * 3
    for a, b in zip(before, after, strict=True):
        assert_array_equal(a, b)
    first.close(), second.close()
