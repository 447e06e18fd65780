"""The bound on the commanded contact force: compensation, task and command keep to it, and lose no more than needed."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.contact_scene import scene

from contactsafe.control.codes import LIMITED_BY_CONTACT
from contactsafe.control.contact_bound import bound_compensation, remove_excess, scale_of_task, tool_task_scale
from contactsafe.control.laws import torque_against_contact

seeds = st.integers(0, 2**32 - 1)
limits = st.floats(0.1, 50.0)


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


@given(st.floats(-50.0, 50.0), limits, st.floats(0.0, 1.0))
def test_task_is_scaled_to_what_is_left_of_the_bound(asked, left, scale):
    found, reason = scale_of_task(asked, left, scale, 0)
    assert 0.0 <= found <= scale
    assert found * asked <= max(left, scale * asked if asked < 0 else left) + 1e-9
    assert (reason == LIMITED_BY_CONTACT) == (found < scale)


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
