"""No inertia is so light that the controller's dampers drive it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contactsafe.control.config import damping_rate
from contactsafe.control.damping import (
    GAIN_MARGIN,
    braking_limit,
    joint_damping_limits,
    largest_damping,
    share_damping,
    task_damping_into,
)
from contactsafe.control.presets import safe

DT = 0.001


def still_moves(M_inv, D, delay, ticks=4000):
    """Let dampers brake random speeds, so many ticks late; give what is left of them."""
    rng = np.random.default_rng(0)
    n = len(D)
    past = [rng.normal(size=n)] * (delay + 1)
    for _ in range(ticks):
        past = [past[0] - DT * M_inv @ (D * past[delay]), *past[:delay]]
        if not np.abs(past[0]).max() < 1e6:
            return math.inf
    return np.abs(past[0]).max()


def random_inverse_inertia(rng, n):
    """Draw an inverse inertia over six decades, coupled as a chain's or as chance has it."""
    B = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-2.0, 2.0, n)
    return B @ B.T + np.diag(10.0 ** rng.uniform(-3.0, 1.0, n))


@pytest.mark.parametrize("delay", range(6))
def test_a_damper_is_stable_just_below_the_limit_and_not_above(delay):
    m = 0.03
    limit = largest_damping(delay) * m / DT
    assert still_moves(np.array([[1.0 / m]]), np.array([0.98 * limit]), delay) < 1e-3
    assert still_moves(np.array([[1.0 / m]]), np.array([1.02 * limit]), delay) > 1e3


@given(st.integers(0, 5), st.floats(0.0, 1.0))
def test_the_characteristic_equation_has_no_root_outside_below_the_limit(delay, share):
    polynomial = np.zeros(delay + 2)
    polynomial[:2] = 1.0, -1.0
    polynomial[-1] += 0.999 * share * largest_damping(delay)
    assert np.abs(np.roots(polynomial)).max() <= 1.0 + 1e-9


@given(st.integers(0, 2**32 - 1), st.integers(1, 10))
def test_joints_coupled_in_any_way_stay_within_the_rate(seed, n):
    M_inv, limits = random_inverse_inertia(np.random.default_rng(seed), n), np.empty(n)
    joint_damping_limits(M_inv, 300.0, limits)
    root = np.sqrt(limits)
    fastest = np.linalg.eigvalsh(root[:, None] * M_inv * root)[-1]
    assert fastest <= 300.0 * (1.0 + 1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(1, 10))
def test_joints_that_are_not_coupled_may_have_all_of_it(seed, n):
    m, limits = 10.0 ** np.random.default_rng(seed).uniform(-6.0, 1.0, n), np.empty(n)
    joint_damping_limits(np.diag(1.0 / m), 300.0, limits)
    assert_allclose(limits, 300.0 * m, rtol=1e-9)


@pytest.mark.parametrize("delay", [0, 1, 2, 4])
def test_the_limit_is_within_a_factor_of_two_of_what_is_unstable(random_arms, panda, six_joint_arm, delay):
    """All joints damped at once, on arms as they are; twice the bound is unstable."""
    rng = np.random.default_rng(1)
    for arm in (panda, six_joint_arm, *random_arms):
        q = rng.uniform(arm.q_min, arm.q_max)
        M_inv, limits = arm.dynamics(q, np.zeros(arm.n))["M_inv"], np.empty(arm.n)
        joint_damping_limits(M_inv, largest_damping(delay) / DT, limits)
        assert still_moves(M_inv, 0.98 * limits, delay) < 1e-3
        assert still_moves(M_inv, 2.0 * limits, delay) > 1e3


@given(st.integers(0, 2**32 - 1), st.integers(1, 10), st.floats(0.0, 0.95))
def test_braking_along_one_direction_takes_what_the_joints_dampers_leave(seed, n, share):
    rng = np.random.default_rng(seed)
    M_inv, limits = random_inverse_inertia(rng, n), np.empty(n)
    M, direction = np.linalg.inv(M_inv), rng.normal(size=n)
    direction /= np.linalg.norm(direction)
    joint_damping_limits(M_inv, 300.0, limits)
    d = braking_limit(direction, M, share * limits, 300.0)
    total = np.diag(share * limits) + d * np.outer(direction, direction)
    L = np.linalg.cholesky(M)
    fastest = np.linalg.eigvalsh(np.linalg.solve(L, np.linalg.solve(L, total).T))[-1]
    assert_allclose(fastest, 300.0, rtol=1e-4)


@given(st.lists(st.floats(0.0, 1e3), min_size=3, max_size=3), st.lists(st.floats(1e-6, 1e3), min_size=3, max_size=3))
def test_a_share_of_damping_never_passes_its_limit(damping, limits):
    share = np.empty(3)
    share_damping(np.array(damping), np.array(limits), share)
    assert (share <= 1.0).all()
    assert (share * damping <= np.array(limits) * (1.0 + 1e-12)).all()
    assert_allclose(share[np.array(damping) <= limits], 1.0)


@given(st.floats(10.0, 1500.0), st.floats(2.0, 120.0))
def test_stiffness_that_acts_late_is_damped_at_least_twice_as_much_as_it_drives(K, D):
    """A spring late by τ is one with a damping of −K τ: what is left of D is half of it at least."""
    found = task_damping_into(np.full(6, K), np.full(6, D), 0.002, np.empty(6))
    assert (found >= D).all()
    assert (found - 0.002 * K >= 0.5 * found - 1e-12).all()


def test_the_dampers_of_a_panda_are_as_configured(panda):
    """Its joints are heavy enough for all of `safe()`, wherever it stands."""
    config, rng, limits = safe(), np.random.default_rng(2), np.empty(7)
    rate = damping_rate(config, GAIN_MARGIN) - 2.0 * math.sqrt(450.0)
    wanted = np.maximum(config.D_pose, config.null_damping) + config.contact_damping
    for _ in range(300):
        joint_damping_limits(panda.dynamics(rng.uniform(panda.q_min, panda.q_max), np.zeros(7))["M_inv"], rate, limits)
        assert (wanted <= 1.05 * limits).all()
