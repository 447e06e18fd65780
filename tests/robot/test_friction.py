"""Joint friction: a smooth step in velocity."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.robot import robots
from contactsafe.robot.friction import joint_friction

speeds = st.lists(st.floats(-3, 3), min_size=7, max_size=7).map(np.array)
PANDA = robots.panda().friction


def test_none_at_rest():
    assert_array_equal(joint_friction(PANDA, np.zeros(7)), 0.0)


@given(speeds)
def test_takes_energy_from_the_joint(qd):
    assert np.all(joint_friction(PANDA, qd) * qd >= 0)


@given(speeds, speeds)
def test_grows_with_speed(qd, more):
    assert np.all(joint_friction(PANDA, np.maximum(qd, more)) >= joint_friction(PANDA, np.minimum(qd, more)))


def test_span_from_fast_backward_to_fast_forward_is_the_first_parameter():
    assert_allclose(joint_friction(PANDA, np.full(7, 50.0)) - joint_friction(PANDA, np.full(7, -50.0)), PANDA[:, 0])


def test_value_by_hand():
    """Without offset: 2/(1 + e^-1) − 1, with φ1 = 2 N m and φ2 q̇ = 1."""
    friction = joint_friction(np.array([[2.0, 4.0, 0.0]]), np.array([0.25]))
    assert_allclose(friction, [0.4621171572600098], rtol=1e-15)
