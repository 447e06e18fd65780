"""The compiled solver: near seeds, limits, and what it does where there is no solution."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.core.rotation import quat_to_matrix
from contactsafe.robot.ik import POSITION_TOLERANCE, ROTATION_TOLERANCE, solve_ik, trac_ik

NEAR = 0.2  # rad a joint, each in a direction of its own


@pytest.fixture(scope="module")
def reachable(panda):
    """Pose, seed near a posture that reaches it, that posture: 500 of them, anywhere within the limits."""
    rng = np.random.default_rng(6)
    q = rng.uniform(panda.q_min, panda.q_max, (500, panda.n))
    seeds = np.clip(q + rng.uniform(-NEAR, NEAR, q.shape), panda.q_min, panda.q_max)
    return [(panda.tool_pose(q_i), seed, q_i) for q_i, seed in zip(q, seeds, strict=True)]


@pytest.fixture
def solve(panda):
    nominal = panda.nominal()

    def run(pose, seed):
        q = np.full(panda.n, np.nan)
        error = solve_ik(nominal.handle, pose.position, pose.quat, seed, panda.q_min, panda.q_max, q)
        return q, error

    return run


def _error(arm, q, pose):
    found = arm.tool_pose(q)
    return np.linalg.norm(found.position - pose.position), 2 * math.acos(min(1.0, abs(found.quat @ pose.quat)))


def test_reaches_every_pose_from_a_near_seed(panda, reachable, solve):
    for pose, seed, _ in reachable:
        q, (position_error, rotation_error) = solve(pose, seed)
        assert position_error <= POSITION_TOLERANCE
        assert rotation_error <= ROTATION_TOLERANCE
        assert_allclose(_error(panda, q, pose), (position_error, rotation_error), rtol=0, atol=1e-7)
        assert np.all(panda.q_min <= q)
        assert np.all(q <= panda.q_max)


def test_reaches_what_trac_ik_reaches(panda, reachable, solve):
    reference = trac_ik(panda, timeout_s=2.0)  # it searches by the clock: a busy machine gets less done
    if reference is None:
        pytest.skip("pytracik is not installed")
    for pose, seed, _ in reachable:
        theirs = reference.ik(pose.position, quat_to_matrix(pose.quat), seed)
        assert theirs is not None
        position_error, rotation_error = _error(panda, theirs, pose)
        assert position_error < 1e-3
        assert rotation_error < 1e-2


def test_a_seed_that_serves_is_the_answer(reachable, solve):
    for pose, _, q_there in reachable:
        assert_array_equal(solve(pose, q_there)[0], q_there)


def test_small_moves_of_the_tool_are_small_moves_of_the_arm(panda, solve):
    """A circle of 10 cm at 60 Hz, each answer the next seed: no jump to another posture on the round."""
    start, q = panda.tool_pose(panda.home), panda.home
    for angle in np.linspace(0, 2 * np.pi, 120):
        pose = start._replace(position=start.position + 0.1 * np.array([np.cos(angle) - 1, np.sin(angle), 0.0]))
        q_next, (position_error, _) = solve(pose, q)
        assert position_error <= POSITION_TOLERANCE
        assert np.abs(q_next - q).max() < 0.05
        q = q_next


def test_out_of_reach_goes_to_the_limit_of_the_arm_and_says_how_far_it_is(panda, solve):
    pose = panda.tool_pose(panda.home)
    q, (position_error, rotation_error) = solve(pose._replace(position=np.array([2.0, 0.0, 0.5])), panda.home)
    assert np.isfinite(q).all()
    assert np.all((panda.q_min <= q) & (q <= panda.q_max))
    assert position_error > 1.0
    assert rotation_error >= 0.0


def test_a_seed_outside_the_limits_is_brought_inside(panda, solve):
    q, (position_error, _) = solve(panda.tool_pose(panda.home), np.full(panda.n, 10.0))
    assert np.all((panda.q_min <= q) & (q <= panda.q_max))
    assert np.isfinite(position_error)


def test_a_target_that_is_not_a_number_leaves_the_seed(panda, solve):
    pose = panda.tool_pose(panda.home)
    q, (position_error, _) = solve(pose._replace(position=np.array([0.4, np.nan, 0.4])), panda.home)
    assert_array_equal(q, panda.home)
    assert np.isnan(position_error)


def test_solves_arms_of_six_joints_too(random_arms):
    (arm,) = (arm for arm in random_arms if arm.n == 6)
    rng, nominal, q = np.random.default_rng(7), arm.nominal(), np.zeros(6)
    for q_there in rng.uniform(arm.q_min, arm.q_max, (50, 6)):
        pose = arm.tool_pose(q_there)
        solve_ik(nominal.handle, *pose, q_there + rng.uniform(-0.02, 0.02, 6), arm.q_min, arm.q_max, q)
        assert _error(arm, q, pose)[0] <= POSITION_TOLERANCE
