"""What each law promises, over random arms, contacts and states."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.control.laws import (
    contact_nullspace,
    damping_wrench,
    line_of_action_misses_tool,
    stiffness_wrench,
    task_error,
    task_inertia,
    task_nullspace,
    torque_against_contact,
)
from contactsafe.core.linalg import shorten
from contactsafe.core.rotation import quat_multiply, quat_to_matrix, rotvec_to_quat

FLOOR, DAMPING = 1e-2, 0.05
seeds = st.integers(0, 2**32 - 1)


def random_arm(seed, n=7, undamped=True):
    """Give J, M⁻¹ and a contact torque of an arm nobody has built; away from singularities unless told."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(n, n))
    M = B @ B.T / n + 0.2 * np.eye(n)
    J, M_inv = rng.normal(size=(6, n)), np.linalg.inv(M)
    if undamped:
        assume(np.linalg.det(J @ M_inv @ J.T) > 10 * FLOOR and np.linalg.cond(J @ M_inv @ J.T) < 1e5)
    return J, M_inv, rng.normal(size=n) * 5.0


def nullspace(J, M_inv):
    """Give Λ, J# and N_t as the tick composes them."""
    Lambda, J_M_inv = task_inertia(J, M_inv, FLOOR, DAMPING)
    J_bar = np.ascontiguousarray(J_M_inv.T @ Lambda)
    return Lambda, J_bar, task_nullspace(J, J_bar)


@given(seeds)
def test_task_inertia_is_the_inverse_of_mobility(seed):
    J, M_inv, _ = random_arm(seed)
    Lambda, J_M_inv = task_inertia(J, M_inv, FLOOR, DAMPING)
    assert_allclose(J_M_inv, J @ M_inv, rtol=0, atol=1e-12)
    assert_allclose(Lambda @ J @ M_inv @ J.T, np.eye(6), rtol=0, atol=1e-7)
    assert_array_equal(Lambda, Lambda.T)


@given(seeds, st.integers(0, 5), st.floats(0.0, 1.0))
def test_task_inertia_stays_bounded_when_a_direction_is_lost(seed, row, kept):
    """At the singularity itself no eigenvalue exceeds 1/λ² = 20: no force grows without bound on approach."""
    J, M_inv, _ = random_arm(seed, undamped=False)
    J[row] *= kept * 1e-6
    Lambda, _ = task_inertia(J, M_inv, FLOOR, DAMPING)
    assert np.linalg.eigvalsh(Lambda)[-1] <= 1.0 / DAMPING * 1.001
    assert np.linalg.eigvalsh(Lambda)[0] > 0


@given(seeds)
def test_damping_of_the_task_inertia_starts_from_zero(seed):
    """Just below the floor Λ is what it is just above: nothing jumps."""
    J, M_inv, _ = random_arm(seed)
    w = np.linalg.det(J @ M_inv @ J.T)
    above, _ = task_inertia(J, M_inv, w * 0.999, DAMPING)
    below, _ = task_inertia(J, M_inv, w * 1.001, DAMPING)
    change = DAMPING * 1e-6 * np.linalg.norm(above, 2) ** 2
    assert_allclose(below, above, rtol=0, atol=2 * change + 1e-9)


@given(seeds)
def test_inverse_jacobian_is_dynamically_consistent(seed):
    J, M_inv, _ = random_arm(seed)
    _, J_bar, N_t = nullspace(J, M_inv)
    assert_allclose(J @ J_bar, np.eye(6), rtol=0, atol=1e-7)
    assert_allclose(N_t @ N_t, N_t, rtol=0, atol=1e-6)


@given(seeds, st.sampled_from([7, 8, 9]))
def test_null_space_torque_does_not_accelerate_the_tool(seed, n):
    J, M_inv, _ = random_arm(seed, n)
    _, _, N_t = nullspace(J, M_inv)
    assert_allclose(J @ M_inv @ N_t.T, 0, atol=1e-7)


@given(seeds)
def test_wrench_at_the_tool_never_shows_in_the_null_space(seed):
    """N_tᵀ Jᵀ F = 0: what is left of the residual there is contact of the arm, sensor or none."""
    J, M_inv, _ = random_arm(seed)
    _, _, N_t = nullspace(J, M_inv)
    F = np.random.default_rng(seed).normal(size=6) * 50.0
    assert_allclose(N_t.T @ J.T @ F, 0, atol=1e-4)


@given(seeds, st.sampled_from([7, 8, 9]))
def test_contact_null_space_accelerates_neither_tool_nor_contact(seed, n):
    J, M_inv, residual = random_arm(seed, n)
    _, _, N_t = nullspace(J, M_inv)
    assume(np.linalg.norm(N_t.T @ residual) > 0.1)
    N_ct = contact_nullspace(N_t, M_inv, residual)
    assert_allclose(J @ M_inv @ N_ct.T, 0, atol=1e-6)
    assert_allclose(residual @ M_inv @ N_ct.T, 0, atol=1e-6)
    assert np.linalg.matrix_rank(N_ct, tol=1e-5) == n - 7


@given(seeds)
def test_seven_joints_have_no_null_space_left_in_contact(seed):
    J, M_inv, residual = random_arm(seed)
    _, _, N_t = nullspace(J, M_inv)
    assume(np.linalg.norm(N_t.T @ residual) > 0.1)
    assert_allclose(contact_nullspace(N_t, M_inv, residual), 0, atol=1e-6)


@given(seeds)
def test_contact_in_task_directions_leaves_the_null_space_alone(seed):
    """The printed law is 0/0 there."""
    J, M_inv, _ = random_arm(seed)
    _, _, N_t = nullspace(J, M_inv)
    at_tool = J.T @ np.random.default_rng(seed).normal(size=6)
    assert_array_equal(contact_nullspace(N_t, M_inv, at_tool), N_t)
    assert_array_equal(contact_nullspace(N_t, M_inv, np.zeros(7)), N_t)


def test_impedance_gives_each_axis_its_own_acceleration():
    """Λ = 2: F = 2 (K e − D ẋ − J̇ q̇), stiffness and damping apart."""
    K, D = np.arange(10.0, 16.0), np.arange(1.0, 7.0)
    e, v, a = np.full(6, 0.1), np.full(6, 0.2), np.full(6, 0.3)
    elastic, damping = stiffness_wrench(2.0 * np.eye(6), e, K, np.inf, np.inf), damping_wrench(2.0 * np.eye(6), v, a, D)
    assert_allclose(elastic, 0.2 * K, rtol=0, atol=1e-14)
    assert_allclose(elastic + damping, [1.0, 0.8, 0.6, 0.4, 0.2, 0.0], rtol=0, atol=1e-14)


@given(seeds, st.floats(0.0, 0.08), st.floats(0.0, 200.0))
def test_a_touch_of_the_tool_never_passes_elsewhere(seed, distance, force):
    """A force of any direction at any point within the tool's radius, and a moment as large as noise may show."""
    rng = np.random.default_rng(seed)
    point, F, noise = rng.normal(size=(3, 3))
    point *= distance / np.linalg.norm(point)
    F *= force / np.linalg.norm(F)
    noise *= 1.99 / np.linalg.norm(noise)
    assert not line_of_action_misses_tool(np.array([*F, *(np.cross(point, F) + noise)]), 0.08, 2.0)


@given(seeds, st.floats(0.1, 1.0), st.floats(0.0, 100.0))
def test_a_force_whose_line_passes_far_from_the_tool_is_not_its(seed, distance, beyond):
    """Once it is large enough for noise not to explain its moment."""
    rng = np.random.default_rng(seed)
    F, point = rng.normal(size=(2, 3))
    F *= (2.0 / (distance - 0.08) + beyond + 0.01) / np.linalg.norm(F)
    point -= F * (F @ point) / (F @ F)
    point *= distance / np.linalg.norm(point)
    assert line_of_action_misses_tool(np.array([*F, *np.cross(point, F)]), 0.08, 2.0)


@given(seeds, st.integers(1, 8), st.floats(1e-3, 100.0))
def test_shortened_vector_keeps_its_direction_and_no_more_than_its_length(seed, n, length_max):
    rng = np.random.default_rng(seed)
    asked = rng.normal(size=n) * 10.0 ** rng.uniform(-4, 4)
    x = asked.copy()
    shorten(x, length_max)
    assert_allclose(x, asked * min(1.0, length_max / np.linalg.norm(asked)), rtol=1e-12, atol=0)


def test_what_has_no_bound_is_left_alone():
    x = np.arange(6.0)
    shorten(x, np.inf)
    assert_array_equal(x, np.arange(6.0))


@given(seeds, st.floats(0.1, 20.0), st.floats(0.1, 100.0))
def test_acceleration_asked_of_the_tool_is_bounded_and_keeps_its_direction(seed, linear_max, angular_max):
    """Λ⁻¹ F = K e, its linear and its angular part each no longer than its bound."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(6, 6))
    Lambda, e, K = B @ B.T + np.eye(6), rng.normal(size=6) * 0.3, rng.uniform(10.0, 1500.0, 6)
    kept, asked = e.copy(), K * e
    acceleration = np.linalg.solve(Lambda, stiffness_wrench(Lambda, e, K, linear_max, angular_max))
    for part, most in ((slice(0, 3), linear_max), (slice(3, 6), angular_max)):
        fraction = min(1.0, most / np.linalg.norm(asked[part]))
        assert_allclose(acceleration[part], fraction * asked[part], rtol=1e-7, atol=1e-9)
    assert_array_equal(e, kept)


@given(seeds, st.floats(1e-3, 3.1))
def test_orientation_error_turns_the_tool_to_its_target(seed, angle):
    """The error is the rotation vector, in world axes, that has to be applied to the actual orientation."""
    rng = np.random.default_rng(seed)
    quat = rng.normal(size=4)
    quat /= np.linalg.norm(quat)
    turn = rng.normal(size=3)
    turn *= angle / np.linalg.norm(turn)
    quat_d = quat_multiply(rotvec_to_quat(turn), quat) * rng.choice([-1, 1])
    x, x_d = rng.normal(size=3), rng.normal(size=3)
    error = task_error(x_d, quat_d, x, quat_to_matrix(quat))
    assert_allclose(error, [*(x_d - x), *turn], rtol=0, atol=1e-9)


@given(seeds, st.floats(-40.0, 40.0))
def test_torque_against_the_contact_is_what_acts_along_it(seed, push):
    """A command −push·a pushes with exactly `push`; what moves the arm across the contact counts nothing."""
    _, M_inv, residual = random_arm(seed)
    a = residual / np.linalg.norm(residual)
    assert_allclose(torque_against_contact(a, M_inv, -push * a), push, rtol=0, atol=1e-9)
    across = np.random.default_rng(seed).normal(size=7)
    across -= a * (a @ M_inv @ across) / (a @ M_inv @ a)
    assert_allclose(torque_against_contact(a, M_inv, across - push * a), push, rtol=0, atol=1e-9)


@given(seeds, st.floats(0.0, 22.0))
def test_removing_the_excess_leaves_the_bound(seed, bound):
    _, M_inv, residual = random_arm(seed)
    a = residual / np.linalg.norm(residual)
    tau = np.random.default_rng(seed).normal(size=7) * 20.0
    push = torque_against_contact(a, M_inv, tau)
    assert_allclose(torque_against_contact(a, M_inv, tau + (push - bound) * a), bound, rtol=0, atol=1e-9)


@pytest.mark.parametrize("joint", range(7))
def test_push_is_positive_when_the_command_opposes_the_contact(panda, joint):
    """Contact pushes the joint forwards (a > 0), the command backwards."""
    M_inv = np.array(panda.dynamics(panda.home, np.zeros(7))["M_inv"])
    a = np.eye(7)[joint]
    assert torque_against_contact(a, M_inv, -5.0 * a) == pytest.approx(5.0)
