"""The reaction: modes follow what a contact shows, bounds fall, and damping only takes energy out."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.contact_scene import scene

from contactsafe import presets
from contactsafe.control.codes import COMPLY, NO_CONTACT, OBSTACLE, PUSH, REJECT
from contactsafe.control.contact_bound import contact_limit, reject_limit
from contactsafe.control.isolation import isolation_dtype
from contactsafe.control.params import fill_params, params_dtype
from contactsafe.control.reaction import begin_reaction, damp_approach, damp_contact, react, reaction_dtype

seeds = st.integers(0, 2**32 - 1)
limits = st.floats(0.1, 50.0)


@pytest.fixture(scope="module")
def params(panda):
    found = np.zeros(1, dtype=params_dtype(7))[0]
    fill_params(found, presets.safe(), panda)
    return found["reaction"]


def begun():
    reaction = np.zeros(1, dtype=reaction_dtype)[0]
    begin_reaction(reaction)
    return reaction


@given(seeds, st.floats(0.0, 300.0))
def test_damping_of_the_approach_takes_energy_out_and_leaves_what_recedes(seed, damping):
    M, _, direction, qd = scene(seed)
    tau = np.zeros(7)
    damp_approach(tau, direction, qd, False, M, np.zeros(7), 300.0, damping)
    if direction @ qd >= 0.0:
        assert_array_equal(tau, 0.0)
    else:
        assert tau @ qd <= 0.0
        assert tau @ direction <= damping * abs(direction @ qd) + 1e-9


def test_an_obstacle_is_complied_with_and_a_push_rejected(params):
    reaction = begun()
    assert react(reaction, COMPLY, NO_CONTACT, 5.0, 10.0, 0.001, params) == COMPLY
    assert react(reaction, COMPLY, PUSH, 5.0, 10.0, 0.001, params) == REJECT
    assert react(reaction, REJECT, NO_CONTACT, 5.0, 10.0, 0.001, params) == REJECT
    assert react(reaction, REJECT, OBSTACLE, 5.0, 10.0, 0.001, params) == COMPLY


def test_bound_of_reject_falls_and_each_confirmed_push_doubles_its_time(params):
    reaction = begun()
    mode = react(reaction, COMPLY, PUSH, 5.0, 10.0, 0.001, params)
    first = float(reaction["reject_decay_s"])
    for _ in range(5000):
        before = float(reaction["reject_limit_nm"])
        mode = react(reaction, mode, NO_CONTACT, 5.0, 10.0, 0.001, params)
        assert reaction["reject_limit_nm"] < before
    react(reaction, mode, PUSH, 5.0, 10.0, 0.001, params)
    assert reaction["reject_decay_s"] == 2.0 * first
    assert_allclose(reaction["reject_limit_nm"], 10.0, rtol=0.01)


def test_a_push_is_resisted_with_a_force_at_the_longest_lever_and_never_less_than_a_multiple_of_its_torque(params):
    isolation = np.zeros(1, dtype=isolation_dtype(7))[0]
    isolation["lever"], isolation["lever_max"] = 0.03, 0.4
    assert_allclose(reject_limit(1.0, isolation, params), 0.4 * params["reject_force_n"])
    assert_allclose(reject_limit(50.0, isolation, params), params["reject_margin"] * 50.0)


def test_bound_of_an_obstacle_falls_from_the_initial_one_to_that_of_comply(params):
    reaction, isolation = begun(), np.zeros(1, dtype=isolation_dtype(7))[0]
    isolation["lever"] = isolation["lever_max"] = 0.4
    bounds = []
    for _ in range(3000):
        react(reaction, COMPLY, NO_CONTACT, 5.0, 10.0, 0.001, params)
        bounds.append(contact_limit(reaction, isolation, params))
    fallen = 1.0 - 0.001 / params["contact_force_limit_decay_s"]
    assert_allclose(bounds[0], 0.4 * params["contact_force_limit_initial_n"] * fallen, rtol=1e-9)
    assert (np.diff(bounds) <= 0.0).all()
    assert bounds[-1] == 0.4 * params["contact_force_limit_comply_n"]


def test_a_contact_begins_without_a_bound_of_an_earlier_one():
    assert begun()["initial_limit_n"] == math.inf


@given(seeds)
def test_arm_drifted_half_a_metre_after_what_it_touched_had_gone(seed):
    """While the contact is not yet over the task is let go: motion to either side is braked."""
    M, _, direction, qd = scene(seed)
    tau = np.zeros(7)
    damp_approach(tau, direction, qd, True, M, np.zeros(7), 300.0, 50.0)
    assert tau @ qd < 0.0


@given(seeds, st.sampled_from([COMPLY, REJECT]))
def test_damping_made_a_tool_late_that_moves_while_its_arm_is_pushed(params, seed, mode):
    """Against a push it takes energy out of the null space alone, the task is not accelerated; else of all joints."""
    _, M_inv, _, qd = scene(seed)
    J = np.random.default_rng(seed).normal(size=(6, 7))
    J_bar = M_inv @ J.T @ np.linalg.inv(J @ M_inv @ J.T)
    N_t = np.eye(7) - J_bar @ J
    damping = np.zeros(7)
    damp_contact(damping, mode, N_t, N_t, qd, np.ones(7), params)
    resisted = np.linalg.norm(J @ M_inv @ damping) > 1e-9 * np.linalg.norm(damping)
    assert resisted == (mode == COMPLY)
    assert qd @ damping < 0.0
