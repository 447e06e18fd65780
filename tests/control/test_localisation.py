"""Places are compared by how well they explain the torques, over all forces that may be there."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contactsafe import robots
from contactsafe.control import evidence, localisation, wrench_information
from contactsafe.control.evidence import Uncertainty
from contactsafe.control.localisation import localisation_dtype
from contactsafe.core.compiled import compiled
from contactsafe.robot.dynamics import dynamics_dtype, update_dynamics

NORMAL_N, ACROSS_N = 30.0, 10.0
NO_BASE = np.zeros(1, wrench_information.told_base_dtype)


@compiled
def _localise(places, handles, torque, sigma, q, prior, times, bases):
    localisation.forget_place(places[0])
    for _ in range(times):
        variance = evidence.moment_variance(torque)
        known = Uncertainty(sigma, variance)
        localisation.localise(places[0], handles[0], torque, known, bases[0], q, 1.0, prior, 1.0)


@compiled
def _evidence(handles, told, index, torque, sigma, variance, point, force):
    n = torque.shape[0]
    wrench_information.inform(told[0], handles[0], torque, sigma)
    link = min(evidence.link_of(handles[0], index, n), n) - 1
    constant = wrench_information.marginalise_moment(told[0].G[link], told[0].h[link], variance)
    return constant + evidence.force_into(handles[0], told[0], index, n, point, force)


@compiled
def _point(handles, index, n, point, normal):
    link = evidence.place_into(handles[0], index, n, point, normal)
    evidence.to_world(handles[0], min(link, n), point, normal)
    return link


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
        told = np.zeros(1, wrench_information.information_dtype(self.arm.n))
        return _evidence(self.handles, told, index, torque, sigma, variance, point, force), force

    def localised(self, torque, sigma, prior=0.02, bases=NO_BASE):
        places = np.zeros(1, localisation_dtype(self.arm.n))
        _localise(places, self.handles, torque, np.full(self.arm.n, sigma), self.q, prior, 1, bases)
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
    localisation.forget_place(places[0])


@compiled
def _go_on(places, handles, torque, sigma, variance, q):
    base = places[0].base  # of before: nothing is told
    localisation.localise(places[0], handles[0], torque, Uncertainty(sigma, variance), base, q, 1.0, 0.02, 1.0)


def test_postures_add_up_as_the_torques_of_one_force_that_turns_with_the_link(panda):
    """Against the covariance of the torques of all postures together, written out for places of the tool."""
    rng, sigma, tools = np.random.default_rng(5), np.full(7, 0.2), [482, 500, 520, 535]
    places, rows = np.zeros(1, localisation_dtype(7)), {k: [] for k in tools}
    _forget(places, panda.home)
    force, torques = np.array([8.0, -6.0, 20.0]), []
    for k in range(3):
        here = Bench(panda, panda.home + k * np.array([0.3, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0]))
        R = here.data.xmat[panda.model.jnt_bodyid[6]].reshape(3, 3)
        for index in tools:
            J_p, J_r = here.jacobian(index)
            rows[index].append((R.T @ J_p, R.T @ J_r))
        torques.append(rows[500][-1][0].T @ force + 0.1 * rng.standard_normal(7))
        for _ in range(3):  # read thrice, it says the same
            _go_on(places, here.handles, torques[-1], sigma, 0.3**2, here.q)
    expected = []
    for index in tools:
        J_p, J_r = (np.hstack([row[part] for row in rows[index]]) for part in (0, 1))
        covariance = np.diag(np.tile(sigma**2, 3)) + NORMAL_N**2 * J_p.T @ J_p + 0.3**2 * J_r.T @ J_r
        expected.append(log_of_gaussian(np.hstack(torques), covariance))
    log = places["log"][0, tools]
    assert_allclose(log - log[0], np.array(expected) - expected[0], rtol=1e-6, atol=1e-6)


def test_what_was_told_of_another_force_is_forgotten(panda):
    """An arm that is touched elsewhere while it moves is not held to what its torques told before."""
    places, sigma = np.zeros(1, localisation_dtype(7)), np.full(7, 0.1)
    here = Bench(panda, panda.home)
    on_4, on_6 = (next(k for k in range(480) if here.point(k)[0] == link) for link in (4, 6))
    _forget(places, panda.home)
    _go_on(places, here.handles, here.torque(on_4, -25.0 * here.point(on_4)[2]), sigma, 0.3**2, here.q)
    there = Bench(panda, panda.home + np.array([0.1, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0]))
    torque = there.torque(on_6, -25.0 * there.point(on_6)[2])
    _elsewhere(places, there.handles, torque, sigma, there.q)
    assert places["differs"][0]
    _elsewhere(places, there.handles, torque, sigma, there.q)
    assert not places["differs"][0]
    assert np.linalg.norm(places["point"][0] - there.point(on_6)[1]) < 0.06


@compiled
def _elsewhere(places, handles, torque, sigma, q):
    known, base = Uncertainty(sigma, evidence.moment_variance(torque)), places[0].base
    localisation.localise(places[0], handles[0], torque, known, base, q, 0.5, 0.02, 1.0)


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
    known, base = Uncertainty(sigma, evidence.moment_variance(torque)), places[0].base
    localisation.localise(places[0], handles[0], torque, known, base, q, 1.0, 0.02, 0.001)


def base_of(here, index, force, sigma_n=0.5, sigma_nm=0.1):
    """Give what a sensor under the base tells of a force on a place."""
    base = np.zeros(1, wrench_information.told_base_dtype)
    base["told"], base["wrench"] = 1, np.concatenate([force, np.cross(here.point(index)[1], force)])
    base["sigma"] = [sigma_n] * 3 + [sigma_nm] * 3
    return base


def set_of(panda, place):
    log = place["log"][: len(panda.places)]
    probability = np.sort(np.exp(log - log.max()))[::-1]
    return int(np.searchsorted(np.cumsum(probability / probability.sum()), 0.95)) + 1


@pytest.mark.parametrize("seed", range(10))
def test_the_wrench_at_the_base_makes_the_set_smaller_and_point_and_force_right(panda, seed):
    here, rng = bench(panda, seed)
    index = int(rng.integers(0, 480))
    point, normal = here.point(index)[1:]
    force = -25.0 * normal + 4.0 * np.cross(normal, [0.6, 0.0, 0.8])
    torque = here.torque(index, force)
    without, told = here.localised(torque, 0.2), here.localised(torque, 0.2, bases=base_of(here, index, force))
    assert set_of(panda, told) < set_of(panda, without)
    assert np.linalg.norm(told["force"] - force) < 1.0
    line = np.linalg.norm(np.cross(told["point"] - point, force)) / np.linalg.norm(force)
    assert line < 0.025
    assert np.linalg.norm(told["point"] - point) < np.linalg.norm(without["point"] - point) + 0.03
    assert told["left_over"] < 1.0


def test_a_wrench_that_no_single_force_has_is_told(panda):
    """The torques of one force, and at the base a couple beside it: as of two contacts that the joints take for one."""
    here = Bench(panda, panda.home)
    index = next(k for k in range(480) if here.point(k)[0] == 5)
    force = -25.0 * here.point(index)[2]
    base = base_of(here, index, force)
    assert here.localised(here.torque(index, force), 0.2, bases=base)["left_over"] < 1.0
    base["wrench"][0, 3:] += 8.0 * here.point(index)[2]
    assert here.localised(here.torque(index, force), 0.2, bases=base)["left_over"] > 1.0
