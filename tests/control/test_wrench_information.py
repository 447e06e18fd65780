"""What torques tell of a wrench on a link, in the link's own frame, against the Jacobians of MuJoCo."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contactsafe import robots
from contactsafe.control import wrench_information
from contactsafe.control.wrench_information import information_dtype, told_base_dtype
from contactsafe.core.compiled import compiled
from contactsafe.robot.dynamics import dynamics_dtype, update_dynamics


@compiled
def _inform(told, handles, torque, sigma):
    wrench_information.inform(told[0], handles[0], torque, sigma)


@compiled
def _inform_of_base(told, handles, bases):
    wrench_information.inform_of_base(told[0], handles[0], bases[0])


@compiled
def _marginalise(told, link, variance):
    return wrench_information.marginalise_moment(told[0].G[link - 1], told[0].h[link - 1], variance)


@pytest.fixture(scope="module")
def panda():
    return robots.panda("hand")


class Posed:
    """An arm in a random posture."""

    def __init__(self, arm, seed):
        self.arm, self.rng = arm, np.random.default_rng(seed)
        self.q = np.clip(arm.home + self.rng.uniform(-0.6, 0.6, arm.n), arm.q_min + 0.1, arm.q_max - 0.1)
        self.nominal = arm.nominal()
        self.handles = np.array([self.nominal.handle])
        update_dynamics(self.nominal.handle, self.q, np.zeros(arm.n), np.zeros(1, dynamics_dtype(arm.n))[0])
        self.data = mujoco.MjData(arm.model)
        self.data.qpos[:] = self.q
        mujoco.mj_kinematics(arm.model, self.data)
        mujoco.mj_comPos(arm.model, self.data)

    def wrench_jacobian(self, link):
        """Give what turns a wrench in the link's frame into joint torques, (6, n)."""
        body = self.arm.model.jnt_bodyid[link - 1]
        J_p, J_r = np.zeros((3, self.arm.n)), np.zeros((3, self.arm.n))
        mujoco.mj_jac(self.arm.model, self.data, J_p, J_r, self.data.xpos[body], body)
        R = self.data.xmat[body].reshape(3, 3)
        return np.vstack([R.T @ J_p, R.T @ J_r])

    def told(self, torque, sigma):
        told = np.zeros(1, information_dtype(self.arm.n))
        _inform(told, self.handles, torque, sigma)
        return told


@given(st.integers(0, 10_000), st.integers(1, 7))
def test_it_is_the_information_of_a_linear_measurement(panda, seed, link):
    """τ = Wᵀ w + noise tells G = W Σ⁻¹ Wᵀ and h = W Σ⁻¹ τ; joints beyond the link tell nothing of it."""
    one = Posed(panda, seed)
    torque, sigma = one.rng.normal(0.0, 5.0, 7), one.rng.uniform(0.05, 0.5, 7)
    told, W = one.told(torque, sigma), one.wrench_jacobian(link)
    assert_allclose(W[:, link:], 0.0, atol=1e-12)
    assert_allclose(told["G"][0, link - 1], W / sigma**2 @ W.T, rtol=1e-9, atol=1e-9)
    assert_allclose(told["h"][0, link - 1], W / sigma**2 @ torque, rtol=1e-9, atol=1e-9)


@given(st.integers(0, 10_000))
def test_a_wrench_that_turns_with_its_link_is_found_from_two_postures_together(panda, seed):
    """Seven torques of one posture are enough for six numbers on the last link; those of two agree with each other."""
    postures = [Posed(panda, 2 * seed), Posed(panda, 2 * seed + 1)]
    wrench = postures[0].rng.normal(0.0, [10.0, 10.0, 10.0, 1.0, 1.0, 1.0])
    G, h = np.zeros((6, 6)), np.zeros(6)
    for one in postures:
        told = one.told(one.wrench_jacobian(7).T @ wrench, np.full(7, 0.1))
        G, h = G + told["G"][0, 6], h + told["h"][0, 6]
    assert_allclose(G @ wrench, h, rtol=1e-6, atol=1e-6 * np.abs(h).max())


@given(st.integers(0, 10_000), st.floats(1e-4, 1.0))
def test_a_moment_that_is_allowed_for_is_as_noise_of_the_torques(panda, seed, variance):
    """(G, h) afterwards are those of the force alone where the torques' covariance has the moment's in it."""
    one, link = Posed(panda, seed), 6
    torque, sigma = one.rng.normal(0.0, 5.0, 7), one.rng.uniform(0.05, 0.5, 7)
    W = one.wrench_jacobian(link)
    covariance = np.diag(sigma**2) + variance * W[3:].T @ W[3:]
    told = one.told(torque, sigma)
    _marginalise(told, link, variance)
    inverse = np.linalg.inv(covariance)
    assert_allclose(told["G"][0, link - 1, :3, :3], W[:3] @ inverse @ W[:3].T, rtol=1e-6, atol=1e-6)
    assert_allclose(told["h"][0, link - 1, :3], W[:3] @ inverse @ torque, rtol=1e-6, atol=1e-5)


@given(st.integers(0, 10_000))
def test_allowing_for_no_moment_changes_nothing(panda, seed):
    one = Posed(panda, seed)
    told = one.told(one.rng.normal(0.0, 5.0, 7), np.full(7, 0.1))
    before = told.copy()
    assert _marginalise(told, 5, 1e-15) == pytest.approx(0.0, abs=1e-6)
    assert_allclose(told["G"], before["G"], rtol=1e-6, atol=1e-6)


def test_less_noise_tells_more(panda):
    one = Posed(panda, 3)
    torque = one.rng.normal(0.0, 5.0, 7)
    quiet, noisy = one.told(torque, np.full(7, 0.1)), one.told(torque, np.full(7, 0.2))
    assert_allclose(quiet["G"], 4.0 * noisy["G"], rtol=1e-12)


def at_base(wrench, sigma):
    base = np.zeros(1, told_base_dtype)
    base["told"], base["wrench"], base["sigma"] = 1, wrench, sigma
    return base


def wrench_at_base(one, link):
    """Give what turns a wrench in the link's frame into that about the world's origin, (6, 6) transposed."""
    body = one.arm.model.jnt_bodyid[link - 1]
    R, origin = one.data.xmat[body].reshape(3, 3), one.data.xpos[body]
    cross = np.array([[0.0, -origin[2], origin[1]], [origin[2], 0.0, -origin[0]], [-origin[1], origin[0], 0.0]])
    return np.block([[R, np.zeros((3, 3))], [cross @ R, R]]).T


@given(st.integers(0, 10_000), st.integers(1, 7))
def test_a_sensor_under_the_base_adds_the_information_of_six_numbers_more(panda, seed, link):
    one = Posed(panda, seed)
    torque, wrench = one.rng.normal(0.0, 5.0, 7), one.rng.normal(0.0, 10.0, 6)
    told, sigma = one.told(torque, np.full(7, 0.2)), one.rng.uniform(0.05, 2.0, 6)
    G, h = told["G"][0, link - 1].copy(), told["h"][0, link - 1].copy()
    _inform_of_base(told, one.handles, at_base(wrench, sigma))
    W = wrench_at_base(one, link)
    assert_allclose(told["G"][0, link - 1], G + W / sigma**2 @ W.T, rtol=1e-9, atol=1e-9)
    assert_allclose(told["h"][0, link - 1], h + W / sigma**2 @ wrench, rtol=1e-9, atol=1e-9)


def test_one_that_is_not_told_adds_nothing(panda):
    one = Posed(panda, 1)
    told = one.told(one.rng.normal(0.0, 5.0, 7), np.full(7, 0.2))
    before, base = told.copy(), at_base(np.full(6, 3.0), np.ones(6))
    base["told"] = 0
    _inform_of_base(told, one.handles, base)
    assert (told == before).all()


@given(st.integers(0, 10_000), st.integers(1, 7))
def test_it_alone_tells_the_whole_wrench_on_any_link(panda, seed, link):
    """Joint torques never do on the first ones: what bends them shows at the base alone."""
    one = Posed(panda, seed)
    on_link = one.rng.normal(0.0, [10.0, 10.0, 10.0, 1.0, 1.0, 1.0])
    told = np.zeros(1, information_dtype(7))
    _inform_of_base(told, one.handles, at_base(wrench_at_base(one, link).T @ on_link, np.ones(6)))
    assert_allclose(np.linalg.solve(told["G"][0, link - 1], told["h"][0, link - 1]), on_link, rtol=1e-6, atol=1e-6)
