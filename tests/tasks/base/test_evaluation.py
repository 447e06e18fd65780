"""Evaluation counts every board once and reads the numbers of the episode that ended. No torch."""

import subprocess
import sys

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from tests.learning.fakes import FakeWiping

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.base.evaluation import evaluate_policy, step_values


class Seeker:
    """Goes straight to the nearest ink."""

    def __init__(self, env):
        self.env = env
        self.calls = 0

    def act(self, observation):
        self.calls += 1
        actions = np.zeros((self.env.num_envs, 18), np.float32)
        for i, board in enumerate(self.env.boards):
            nearest = board.points[np.linalg.norm(board.points - self.env.xy[i], axis=1).argmin()]
            actions[i, :2] = np.clip((nearest - self.env.xy[i]) / 0.02, -1, 1)
        return actions


class Idler(Seeker):
    def act(self, observation):
        self.calls += 1
        return np.zeros((self.env.num_envs, 18), np.float32)


def test_a_good_policy_cleans_and_an_idle_one_does_not():
    env = FakeWiping(4)
    good = evaluate_policy(Seeker(env), env, 10, seed=5)
    assert good["episodes"] == 12
    assert good["success"] == 1.0
    assert good["ink_removed_mean"] == 1.0
    assert 0.0 < good["time_to_success_median_s"] < 1.0
    assert good["peak_force_max_n"] == good["contact_force_median_n"] == 3.0
    idle = evaluate_policy(Idler(env), env, 10, seed=5)
    assert idle["success"] == 0.0
    assert idle["ink_removed_mean"] < 0.5
    assert np.isnan(idle["time_to_success_median_s"])
    assert all(record["time_s"] == 1.0 for record in idle["records"])


@pytest.mark.parametrize(("trained", "steps"), [(30.0, 60.0), (60.0, 30.0)])
def test_a_policy_trained_for_another_rate_is_refused_before_it_moves_anything(trained, steps):
    env = FakeWiping(2)
    policy = Seeker(env)
    policy.rate_hz = trained
    told = f"the policy acts at {trained:g} Hz, the environment steps at {steps:g} Hz; give a policy trained so"
    with pytest.raises(InvalidInputError, match=told):
        evaluate_policy(policy, env, 2, seed=0, rate_hz=steps)
    assert policy.calls == 0
    assert evaluate_policy(policy, env, 2, seed=0, rate_hz=trained)["episodes"] == 2


def test_same_seed_same_figures():
    env = FakeWiping(3)
    first, second, other = (evaluate_policy(Seeker(env), env, 6, seed=s) for s in (1, 1, 2))
    assert first["records"] == second["records"] != other["records"]


def test_numbers_of_the_ended_episode_come_from_final_info():
    info = {"ink_left": np.array([0.3, 1.0]), "final_info": {"ink_left": np.array([0.0, 0.1])}}
    np.testing.assert_array_equal(step_values(info, np.array([False, True]), "ink_left"), [0.3, 0.1])
    np.testing.assert_array_equal(step_values(info, np.array([False, True]), "absent"), [0.0, 0.0])


def test_running_a_policy_needs_no_torch():
    """A robot's computer, and the demo's, have none."""
    code = (
        "import sys, contactsafe.policy.policy, contactsafe.policy.bundle, contactsafe.tasks.base.evaluation\n"
        "assert not {'torch', 'stable_baselines3', 'onnx'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_an_environment_that_resets_otherwise_is_refused():
    env = FakeWiping(1)
    env.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}
    with pytest.raises(InvalidInputError) as error:
        evaluate_policy(None, env, 1, seed=0)
    assert str(error.value) == (
        "the environment resets by AutoresetMode.NEXT_STEP; make it with AutoresetMode.SAME_STEP"
    )


def test_no_episodes_is_refused():
    with pytest.raises(InvalidInputError) as error:
        evaluate_policy(None, FakeWiping(1), 0, seed=0)
    assert str(error.value) == "episodes = 0; give 1 or more"
