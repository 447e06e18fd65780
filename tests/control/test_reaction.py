"""The reaction's laws, one by one: each keeps the commanded contact force within its bound."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe import presets
from contactsafe.control.codes import COMPLY, LIMITED_BY_CONTACT, NO_CONTACT, OBSTACLE, PUSH, REJECT
from contactsafe.control.isolation import isolation_dtype
from contactsafe.control.laws import torque_against_contact
from contactsafe.control.params import fill_params, params_dtype
from contactsafe.control.reaction import (
    begin_reaction,
    bound_compensation,
    contact_limit,
    damp_approach,
    react,
    reaction_dtype,
    remove_excess,
    scale_of_task,
    tool_task_scale,
)

seeds = st.integers(0, 2**32 - 1)
limits = st.floats(0.1, 50.0)


def scene(seed, n=7):
    """Return inertia, its inverse, a unit direction and a command, all random."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(n, n))
    M = B @ B.T / n + 0.2 * np.eye(n)
    direction = rng.normal(size=n)
    return M, np.linalg.inv(M), direction / np.linalg.norm(direction), 20.0 * rng.normal(size=n)


@pytest.fixture(scope="module")
def params(panda):
    found = np.zeros(1, dtype=params_dtype(7))[0]
    fill_params(found, presets.safe(), panda)
    return found["reaction"]


def begun():
    reaction = np.zeros(1, dtype=reaction_dtype)[0]
    begin_reaction(reaction)
    return reaction


@given(seeds, limits)
def test_compensation_never_presses_harder_than_the_bound(seed, limit):
    _, M_inv, direction, compensation = scene(seed)
    before = compensation.copy()
    asked = bound_compensation(compensation, direction, M_inv, limit)
    assert torque_against_contact(direction, M_inv, compensation) <= limit + 1e-9
    if asked <= limit:
        assert_array_equal(compensation, before)


@given(seeds, limits)
def test_excess_is_removed_exactly_and_nothing_else(seed, limit):
    _, M_inv, direction, tau = scene(seed)
    asked = torque_against_contact(direction, M_inv, tau)
    remove_excess(tau, direction, M_inv, limit)
    assert_allclose(torque_against_contact(direction, M_inv, tau), min(asked, limit), rtol=1e-9, atol=1e-9)


@given(seeds, st.floats(0.0, 300.0))
def test_damping_of_the_approach_takes_energy_out_and_leaves_what_recedes(seed, damping):
    M, _, direction, qd = scene(seed)
    tau = np.zeros(7)
    damp_approach(tau, direction, qd, M, np.zeros(7), 300.0, damping)
    if direction @ qd >= 0.0:
        assert_array_equal(tau, 0.0)
    else:
        assert tau @ qd <= 0.0
        assert tau @ direction <= damping * abs(direction @ qd) + 1e-9


@given(st.floats(-50.0, 50.0), limits, st.floats(0.0, 1.0))
def test_task_is_scaled_to_what_is_left_of_the_bound(asked, left, scale):
    found, reason = scale_of_task(asked, left, scale, 0)
    assert 0.0 <= found <= scale
    assert found * asked <= max(left, scale * asked if asked < 0 else left) + 1e-9
    assert (reason == LIMITED_BY_CONTACT) == (found < scale)


def test_an_obstacle_is_complied_with_and_a_push_rejected(params):
    reaction = begun()
    assert react(reaction, COMPLY, NO_CONTACT, 5.0, 0.001, params) == COMPLY
    assert react(reaction, COMPLY, PUSH, 5.0, 0.001, params) == REJECT
    assert react(reaction, REJECT, NO_CONTACT, 5.0, 0.001, params) == REJECT
    assert react(reaction, REJECT, OBSTACLE, 5.0, 0.001, params) == COMPLY


def test_bound_of_reject_falls_and_each_confirmed_push_doubles_its_time(params):
    reaction = begun()
    mode = react(reaction, COMPLY, PUSH, 5.0, 0.001, params)
    first = float(reaction["reject_decay_s"])
    for _ in range(5000):
        before = float(reaction["reject_limit_nm"])
        mode = react(reaction, mode, NO_CONTACT, 5.0, 0.001, params)
        assert reaction["reject_limit_nm"] < before
    react(reaction, mode, PUSH, 5.0, 0.001, params)
    assert reaction["reject_decay_s"] == 2.0 * first
    assert_allclose(reaction["reject_limit_nm"], params["reject_margin"] * 5.0, rtol=0.01)


def test_bound_of_an_obstacle_falls_from_the_initial_one_to_that_of_comply(params):
    reaction, isolation = begun(), np.zeros(1, dtype=isolation_dtype(7))[0]
    isolation["lever"] = isolation["lever_max"] = 0.4
    bounds = []
    for _ in range(3000):
        react(reaction, COMPLY, NO_CONTACT, 5.0, 0.001, params)
        bounds.append(contact_limit(reaction, isolation, params))
    assert_allclose(bounds[0], 0.4 * params["contact_force_limit_initial_n"], rtol=0.01)
    assert (np.diff(bounds) <= 0.0).all()
    assert bounds[-1] == 0.4 * params["contact_force_limit_comply_n"]


def test_a_contact_begins_without_a_bound_of_an_earlier_one():
    assert begun()["initial_limit_n"] == math.inf


@given(seeds, st.floats(0.0, 60.0), st.floats(0.0, 40.0))
def test_tool_is_never_pulled_harder_than_the_bound_against_what_touches_it(seed, touch, bound):
    """Along the force felt, from twice the least contact on; a force within the bound is left as it is."""
    rng = np.random.default_rng(seed)
    F, n = rng.normal(size=6) * 30.0, rng.normal(size=3)
    n /= np.linalg.norm(n)
    scale, reason = tool_task_scale(F, touch * n, 3.0, bound)
    push = -n @ F[:3]
    assert 0.0 <= scale <= 1.0
    if touch < 3.0 or push <= bound:
        assert (scale, reason) == (1.0, 0)
    elif touch >= 6.0:
        assert_allclose(scale * push, bound, rtol=1e-9, atol=1e-9)
    else:
        assert scale * push >= bound - 1e-9


@given(st.floats(2.9, 6.1), st.floats(-1e-6, 1e-6))
def test_bound_on_the_tool_sets_in_without_a_step(touch, more):
    """A touch that comes and goes about the least one would otherwise jerk the arm."""
    F, n = np.array([0.0, 0.0, -60.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    a, b = (tool_task_scale(F, size * n, 3.0, 20.0)[0] for size in (touch, touch + more))
    assert abs(a - b) < 1e-5
