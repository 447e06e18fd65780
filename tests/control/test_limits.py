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


def stop(q, qd):
    return joint_stop_torque(np.array(q), np.array(qd), Q_MIN, Q_MAX, 0.1, 200.0, 30.0)


@given(st.floats(-1.9, 1.9), st.floats(-2.9, -0.2), st.floats(-5, 5), st.floats(-5, 5))
def test_no_joint_stop_away_from_the_limits(q0, q1, qd0, qd1):
    assert_array_equal(stop([q0, q1], [qd0, qd1]), 0.0)


def test_joint_stop_is_a_spring_from_the_margin_on():
    """0.05 rad inside the margin of 0.1: 200 N m/rad give 10 N m, inwards at either end."""
    assert_allclose(stop([-1.95, -0.15], [0.0, 0.0]), [10.0, -10.0], rtol=1e-12)


def test_joint_stop_damps_motion_outwards_alone():
    """Half of the margin intruded: half of 30 N m s/rad, at 2 rad/s 30 N m, and none on the way back."""
    assert_allclose(stop([-1.95, -0.15], [-2.0, 2.0]), [40.0, -40.0], rtol=1e-12)
    assert_allclose(stop([-1.95, -0.15], [2.0, -2.0]), [10.0, -10.0], rtol=1e-12)


@given(st.floats(-0.5, 0.5), st.floats(-3, 3))
def test_joint_stop_always_pushes_inwards(beyond, qd):
    low, high = stop([-2.0 + beyond, -2.0], [qd, 0.0])[0], stop([2.0 - beyond, -2.0], [-qd, 0.0])[0]
    assert low >= 0.0
    assert high == -low
