"""Limits hold whatever is asked."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.control.laws import joint_stop_torque, limit_torque

TAU_MAX = np.array([87.0, 87.0, 12.0])
torques = arrays(float, 3, elements=st.floats(-1e6, 1e6))


@given(torques, arrays(float, 3, elements=st.floats(-1.0, 1.0)))
def test_torque_and_its_rate_stay_within_limits(tau, share):
    previous = share * TAU_MAX
    asked = tau.copy()
    clipped = limit_torque(tau, previous, TAU_MAX, 1.0)
    assert (np.abs(tau) <= TAU_MAX).all()
    assert (np.abs(tau - previous) <= 1.0 + 1e-12).all()
    assert clipped == (tau != asked).any()


def test_what_is_within_limits_passes_unchanged():
    tau = np.array([10.5, -86.0, 11.9])
    assert not limit_torque(tau, np.array([10.0, -86.5, 12.0]), TAU_MAX, 1.0)
    assert_array_equal(tau, [10.5, -86.0, 11.9])


def test_limit_is_reached_exactly():
    tau = np.array([20.0, -90.0, 50.0])
    assert limit_torque(tau, np.array([10.0, -86.5, 11.5]), TAU_MAX, 1.0)
    assert_array_equal(tau, [11.0, -87.0, 12.0])


Q_MIN, Q_MAX = np.array([-2.0, -3.0]), np.array([2.0, -0.1])
MARGIN, STIFFNESS, DAMPING = 0.1, 200.0, 30.0


def stop(tau, q, qd):
    """Give what a command becomes at the joint stops."""
    out = np.array(tau, dtype=float)
    joint_stop_torque(out, np.array(q), np.array(qd), Q_MIN, Q_MAX, MARGIN, STIFFNESS, DAMPING)
    return out


commands, speeds = st.floats(-100, 100), st.floats(-5, 5)


@given(commands, commands, st.floats(-1.9, 1.9), st.floats(-2.9, -0.2), speeds, speeds)
def test_away_from_the_limits_nothing_changes(tau0, tau1, q0, q1, qd0, qd1):
    assert_array_equal(stop([tau0, tau1], [q0, q1], [qd0, qd1]), [tau0, tau1])


@given(commands, st.floats(0.0, 0.5), speeds)
def test_joint_stop_never_pulls_towards_the_limit(tau, depth, qd):
    """What is added points inwards at either end, and both ends are alike."""
    low = stop([tau, 0.0], [-1.9 - depth, -2.0], [qd, 0.0])[0]
    high = stop([-tau, 0.0], [1.9 + depth, -2.0], [-qd, 0.0])[0]
    assert low >= tau
    assert_allclose(high, -low, rtol=1e-12, atol=1e-12)


@given(commands, st.floats(0.1, 0.5), speeds)
def test_at_the_limit_and_beyond_no_command_pushes_outwards(tau, depth, qd):
    """There the spring alone is left of a command that leads out: 200 N m/rad × 0.1 rad and more."""
    left = stop([tau, 0.0], [-1.9 - depth, -2.0], [qd, 0.0])[0]
    assert left >= STIFFNESS * MARGIN * 0.999


@given(st.floats(0.0, 100.0), st.floats(0.0, 0.1))
def test_what_pushes_outwards_fades_over_the_margin(push, depth):
    share = depth / MARGIN
    left = stop([-push, 0.0], [-1.9 - depth, -2.0], [0.0, 0.0])[0]
    assert_allclose(left, -push * (1 - share) + STIFFNESS * depth, rtol=0, atol=1e-9)


@given(st.floats(0.0, 100.0), st.floats(0.0, 0.5))
def test_what_pushes_inwards_is_left_and_helped(push, depth):
    left = stop([push, 0.0], [-1.9 - depth, -2.0], [1.0, 0.0])[0]
    spring = STIFFNESS * depth * max(depth / MARGIN, 1.0)
    assert_allclose(left, push + spring, rtol=1e-9, atol=1e-9)


def test_joint_stop_damps_motion_outwards_alone():
    """Half of the margin intruded: half of 30 N m s/rad, at 2 rad/s 30 N m, and none on the way back."""
    assert_allclose(stop([0, 0], [-1.95, -0.15], [-2.0, 2.0]), [40.0, -40.0], rtol=1e-9)
    assert_allclose(stop([0, 0], [-1.95, -0.15], [2.0, -2.0]), [10.0, -10.0], rtol=1e-9)


@given(commands, st.floats(-1e-9, 1e-9))
def test_nothing_jumps_where_the_stop_begins(tau, beyond):
    assert_allclose(stop([tau, 0.0], [-1.9 - beyond, -2.0], [-3.0, 0.0])[0], tau, rtol=0, atol=1e-5)
