"""The wiping task in PyBullet: the same surface, the same boards, the same motion."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.bundle import shipped_bundle
from contactsafe.policy.policy import Policy
from contactsafe.tasks import ENGINES, make_vec
from contactsafe.tasks.base.evaluation import evaluate_policy
from contactsafe.tasks.wiping.config import WipingConfig

pytest.importorskip("pybullet")

SHORT = WipingConfig(episode_s=0.3)
"""18 policy steps."""


@pytest.fixture
def both():
    engines = [make_vec("wiping", 2, SHORT, name) for name in ENGINES]
    yield engines
    for engine in engines:
        engine.close()


def test_spaces_boards_and_infos_are_the_same(both):
    mujoco, bullet = both
    assert bullet.observation_space == mujoco.observation_space
    assert bullet.action_space == mujoco.action_space
    assert bullet.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert_array_equal(bullet.unwrapped.camera_homography, mujoco.unwrapped.camera_homography)
    (seen, told), (seen_too, told_too) = (engine.reset(seed=5) for engine in both)
    assert told.keys() == told_too.keys()
    for key in seen:
        assert_array_equal(seen[key], seen_too[key])
    idle = np.zeros((2, 18), np.float32)
    for _ in range(18):
        (_, _, _, ended, info), (_, _, _, ended_too, info_too) = (engine.step(idle) for engine in both)
        assert_array_equal(ended, ended_too)
        assert info.keys() == info_too.keys()
    assert ended.all()


def test_the_same_actions_move_the_tool_alike(both):
    actions = np.zeros((2, 18), np.float32)
    actions[:, 0], actions[:, 1], actions[:, 2] = 0.5, (1.0, -1.0), 1.0
    for engine in both:
        engine.reset(seed=1)
    for _ in range(17):
        seen, seen_too = (engine.step(actions)[0] for engine in both)
        assert_allclose(seen_too["pose"], seen["pose"], atol=1e-3)
    assert np.abs(seen["pose"][0, 1] - seen["pose"][1, 1]) > 0.05


def test_a_bundle_runs_unchanged():
    engine = make_vec("wiping", 1, engine="pybullet", config=SHORT)
    results = evaluate_policy(Policy(shipped_bundle("wiping"), engine.unwrapped.camera_homography), engine, 2, seed=0)
    assert results["episodes"] == 2
    assert [record["time_s"] for record in results["records"]] == [0.3, 0.3]
    engine.close()


def test_single_environment():
    env = gymnasium.make("contactsafe/Wiping-v0", config=SHORT, engine="pybullet")
    observation, _ = env.reset(seed=0)
    after, reward, terminated, truncated, info = env.step(np.zeros(18, np.float32))
    assert after in env.observation_space
    assert_allclose(after["pose"], observation["pose"], atol=1e-3)
    assert np.isfinite(reward)
    assert not terminated
    assert not truncated
    assert not info["arm_touched"]
    env.close()


@pytest.mark.slow
def test_the_shipped_policy_wipes_in_the_second_engine():
    engine = make_vec("wiping", 1, engine="pybullet", config=WipingConfig())
    results = evaluate_policy(
        Policy(shipped_bundle("wiping"), engine.unwrapped.camera_homography), engine, 3, seed=1_000_003
    )
    engine.close()
    assert results["ink_removed_mean"] > 0.95
    assert results["peak_force_max_n"] < 40.0


def test_an_unknown_engine_is_told():
    with pytest.raises(InvalidInputError) as caught:
        make_vec("wiping", 1, engine="gazebo")
    assert str(caught.value) == "engine = 'gazebo'; choose mujoco or pybullet"
