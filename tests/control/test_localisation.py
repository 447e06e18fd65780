"""Places are compared by how well they explain the torques, over all forces that may be there."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contactsafe import robots
from contactsafe.control import evidence, localisation
from contactsafe.control.evidence import Uncertainty
from contactsafe.control.localisation import localisation_dtype
from contactsafe.core.compiled import compiled
from contactsafe.robot.dynamics import dynamics_dtype, update_dynamics

NORMAL_N, ACROSS_N = 30.0, 10.0


@compiled
def _localise(places, handles, torque, sigma, q, prior, times):
    localisation.forget_place(places[0], q)
    for _ in range(times):
        variance = evidence.moment_variance(torque)
        localisation.localise(places[0], handles[0], torque, Uncertainty(sigma, variance), q, prior, 1.0)


@compiled
def _evidence(handles, index, torque, sigma, variance, point, force):
    return evidence.force_into(handles[0], index, torque, Uncertainty(sigma, variance), point, force)


@compiled
def _point(handles, index, n, point, normal):
    return evidence.point_into(handles[0], index, n, point, normal)


class Bench:
    """An arm in a posture, and what its places explain."""

    def __init__(self, arm, q):
        self.arm, self.q, self.nominal = arm, q, arm.nominal()
        self.handles = np.array([self.nominal.handle])
        update_dynamics(self.nominal.handle, q, np.zeros(arm.n), np.zeros(1, dynamics_dtype(arm.n))[0])
        self.data = mujoco.MjData(arm.model)
        self.data.qpos[:] = q
        mujoco.mj_kinematics(arm.model, self.data)
        mujoco.mj_comPos(arm.model, self.data)

    def point(self, index):
        point, normal = np.zeros(3), np.zeros(3)
        link = _point(self.handles, index, self.arm.n, point, normal)
        return link, point, normal

    def jacobian(self, index):
        """Give J_p and J_r of a place, (3, n) each."""
        link, point, _ = self.point(index)
        body = self.arm.model.jnt_bodyid[min(link, self.arm.n) - 1]
        J_p, J_r = np.zeros((3, self.arm.n)), np.zeros((3, self.arm.n))
        mujoco.mj_jac(self.arm.model, self.data, J_p, J_r, point, body)
        return J_p, J_r

    def torque(self, index, force):
        return self.jacobian(index)[0].T @ force

    def evidence(self, index, torque, sigma, variance):
        point, force = np.zeros(3), np.zeros(3)
        return _evidence(self.handles, index, torque, sigma, variance, point, force), force

    def localised(self, torque, sigma, prior=0.02):
        places = np.zeros(1, localisation_dtype(self.arm.n))
        _localise(places, self.handles, torque, np.full(self.arm.n, sigma), self.q, prior, 1)
        return places[0]


@pytest.fixture(scope="module")
def panda():
    return robots.panda("hand")


def bench(arm, seed):
    rng = np.random.default_rng(seed)
    return Bench(arm, np.clip(arm.home + rng.uniform(-0.6, 0.6, arm.n), arm.q_min + 0.1, arm.q_max - 0.1)), rng


def log_of_gaussian(torque, covariance):
    return -0.5 * (torque @ np.linalg.solve(covariance, torque) + np.linalg.slogdet(covariance)[1])


@given(st.integers(0, 10_000))
def test_the_evidence_of_two_tool_points_differs_as_that_of_gaussian_forces_and_moments_does(panda, seed):
    """The closed form in wrench space against the covariance of the torques, written out."""
    here, rng = bench(panda, seed)
    of_tool = len(panda.places) - 1 - rng.integers(0, 50, 2)
    torque, sigma, variance = rng.normal(0.0, 4.0, 7), rng.uniform(0.1, 0.5, 7), 0.3**2
    found, expected = [], []
    for index in of_tool:
        J_p, J_r = here.jacobian(index)
        covariance = np.diag(sigma**2) + NORMAL_N**2 * J_p.T @ J_p + variance * J_r.T @ J_r
        found.append(here.evidence(index, torque, sigma, variance)[0])
        expected.append(log_of_gaussian(torque, covariance))
    assert_allclose(found[0] - found[1], expected[0] - expected[1], rtol=1e-6, atol=1e-6)


@given(st.integers(0, 10_000))
def test_the_force_at_a_place_is_the_likeliest_one(panda, seed):
    here, rng = bench(panda, seed)
    index = int(rng.integers(0, 480))
    torque, sigma, variance = rng.normal(0.0, 4.0, 7), rng.uniform(0.1, 0.5, 7), 0.3**2
    J_p, J_r = here.jacobian(index)
    _, _, normal = here.point(index)
    S = ACROSS_N**2 * np.eye(3) + (NORMAL_N**2 - ACROSS_N**2) * np.outer(normal, normal)
    covariance = np.diag(sigma**2) + variance * J_r.T @ J_r
    expected = S @ J_p @ np.linalg.solve(J_p.T @ S @ J_p + covariance, torque)
    assert_allclose(here.evidence(index, torque, sigma, variance)[1], expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_what_a_force_on_a_place_does_is_found_there(panda, seed):
    here, rng = bench(panda, seed)
    while True:
        index = int(rng.integers(0, 480))
        link, point, normal = here.point(index)
        torque = here.torque(index, -25.0 * normal)
        if link >= 3 and np.abs(torque).max() > 3.0:
            break
    place = here.localised(torque, 0.05)
    probability = np.exp(place["log"][: len(panda.places)] - place["log"][: len(panda.places)].max())
    probability /= probability.sum()
    assert probability[index] > 1e-3
    near = [k for k in np.argsort(-probability)[:40] if np.linalg.norm(here.point(k)[1] - point) < 0.05]
    assert near


def test_joints_beyond_a_link_tell_that_it_is_not_further_out(panda):
    """A force on the elbow leaves the wrist's joints alone; on the hand it would have to pass through three axes."""
    here = Bench(panda, panda.home)
    on_link_4 = [k for k in range(480) if here.point(k)[0] == 4]
    torques = [here.torque(k, -30.0 * here.point(k)[2]) for k in on_link_4]
    strongest = max(torques, key=lambda torque: np.abs(torque).max())
    place = here.localised(strongest, 0.05)
    assert place["link"] <= 5
    assert place["tool_probability"] < 0.05


def test_a_press_of_the_tool_is_the_tools_where_no_sensor_takes_it_out(panda):
    here = Bench(panda, panda.home)
    tcp = 480
    link, point, _ = here.point(tcp)
    assert link == 8
    assert_allclose(point, panda.tool_pose(panda.home).position, atol=1e-12)
    place = here.localised(here.torque(tcp, np.array([6.0, -5.0, 15.0])), 0.05, prior=0.4)
    assert place["tool_probability"] > 0.5


def test_a_second_posture_makes_the_set_smaller_and_a_third_reading_of_the_same_does_not(panda):
    rng = np.random.default_rng(3)
    first = Bench(panda, panda.home)
    index = next(k for k in rng.permutation(480) if first.point(k)[0] == 6)
    places = np.zeros(1, localisation_dtype(7))

    def read(q):
        here = Bench(panda, q)
        torque = here.torque(index, -25.0 * here.point(index)[2]) + 0.1 * rng.standard_normal(7)
        variance = evidence.moment_variance(torque)
        _go_on(places, here.handles, torque, np.full(7, 0.2), variance, q)
        log = places["log"][0, : len(panda.places)]
        probability = np.exp(log - log.max())
        probability = np.sort(probability / probability.sum())[::-1]
        return int(np.searchsorted(np.cumsum(probability), 0.95)) + 1

    _forget(places, panda.home)
    alone = read(panda.home)
    assert read(panda.home) > 0.5 * alone
    sizes = [read(panda.home + step * np.array([0.3, -0.2, 0.3, 0.3, -0.4, 0.3, 0.0])) for step in (1.0, 2.0, 3.0)]
    assert sizes[-1] < alone


@compiled
def _forget(places, q):
    localisation.forget_place(places[0], q)


@compiled
def _go_on(places, handles, torque, sigma, variance, q):
    localisation.localise(places[0], handles[0], torque, Uncertainty(sigma, variance), q, 0.02, 1.0)


def test_what_a_posture_said_is_added_once_when_the_arm_has_left_it(panda):
    """Evidence of N postures, the one of now among them, over the root of N."""
    places, sigma = np.zeros(1, localisation_dtype(7)), np.full(7, 0.2)
    postures = [panda.home + k * np.array([0.3, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0]) for k in range(3)]
    torques = [np.array([2.0, 5.0, 1.0, -3.0, 0.2, 0.1, 0.0]), np.array([1.0, 4.0, 1.5, -3.0, 0.1, 0.0, 0.0])]
    torques.append(np.array([3.0, 4.0, 1.0, -2.0, 0.0, 0.3, 0.0]))
    _forget(places, postures[0])
    said = []
    for q, torque in zip(postures, torques, strict=True):
        here = Bench(panda, q)
        variance = evidence.moment_variance(torque)
        for _ in range(3):  # read thrice, it says the same
            _go_on(places, here.handles, torque, sigma, variance, q)
        said.append(np.array([here.evidence(k, torque, sigma, variance)[0] for k in range(0, 480, 20)]))
    together = sum(one - one[0] for one in said) / np.sqrt(3.0)
    log = places["log"][0, 0:480:20]
    assert_allclose(log - log[0], together, rtol=1e-6, atol=1e-6)


def test_a_sweep_compares_all_points_by_the_same_torque(panda):
    """Torques that grow while a part of the points is compared would favour the last ones."""
    here, places = Bench(panda, panda.home), np.zeros(1, localisation_dtype(7))
    index = next(k for k in range(480) if here.point(k)[0] == 4)
    torque = here.torque(index, -20.0 * here.point(index)[2])
    _forget(places, panda.home)
    for k in range(60):
        _part(places, here.handles, (1.0 + 0.1 * k) * torque, np.full(7, 0.1), panda.home)
        assert places["link"][0] in (3, 4, 5)


@compiled
def _part(places, handles, torque, sigma, q):
    variance = evidence.moment_variance(torque)
    localisation.localise(places[0], handles[0], torque, Uncertainty(sigma, variance), q, 0.02, 0.001)
