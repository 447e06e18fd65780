"""Rotations: every way round and back, at every angle."""

import math

import mujoco
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contactsafe.core.rotation import (
    matrix_to_quat,
    orientation_error,
    quat_multiply,
    quat_to_matrix,
    quat_to_rotvec,
    rotvec_to_quat,
)

near_half_turn = st.builds(
    lambda exponent, side: math.pi + side * 10.0**exponent, st.floats(-16, -1), st.sampled_from((-1, 1))
)
angles = st.one_of(st.floats(0.0, 2 * math.pi), near_half_turn, st.floats(-16, -1).map(lambda exponent: 10.0**exponent))


@st.composite
def quaternions(draw):
    axis = np.array(draw(st.tuples(*3 * [st.floats(-1, 1)]).filter(lambda v: np.linalg.norm(v) > 1e-3)))
    angle = draw(angles)
    return np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis / np.linalg.norm(axis))])


def assert_same_rotation(a, b, atol=1e-12):
    assert_allclose(a if a @ b >= 0 else -a, b, rtol=0, atol=atol)


@given(quaternions())
def test_matrix_is_a_rotation(quat):
    R = quat_to_matrix(quat)
    assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-14)
    assert_allclose(np.linalg.det(R), 1, rtol=0, atol=1e-14)


@given(quaternions())
def test_quaternion_to_matrix_and_back(quat):
    back = matrix_to_quat(quat_to_matrix(quat))
    assert back[0] >= 0
    assert_same_rotation(back, quat)


@given(quaternions())
def test_quaternion_to_rotation_vector_and_back(quat):
    rotvec = quat_to_rotvec(quat)
    assert np.linalg.norm(rotvec) <= math.pi + 1e-12
    assert_same_rotation(rotvec_to_quat(rotvec), quat)


@given(quaternions())
def test_a_quaternion_and_its_opposite_are_one_rotation(quat):
    R = quat_to_matrix(quat)
    assert_allclose(quat_to_matrix(-quat), R, rtol=0, atol=0)
    assert_allclose(quat_to_matrix(rotvec_to_quat(quat_to_rotvec(-quat))), R, rtol=0, atol=1e-12)


@given(quaternions(), quaternions())
def test_product_of_quaternions_is_product_of_matrices(a, b):
    assert_allclose(quat_to_matrix(quat_multiply(a, b)), quat_to_matrix(a) @ quat_to_matrix(b), rtol=0, atol=1e-14)


@given(quaternions(), quaternions())
def test_orientation_error_turns_the_actual_into_the_desired(desired, actual):
    error = orientation_error(desired, quat_to_matrix(actual))
    assert_same_rotation(quat_multiply(rotvec_to_quat(error), actual), desired)


@given(quaternions())
def test_matrix_agrees_with_mujoco(quat):
    theirs = np.zeros(9)
    mujoco.mju_quat2Mat(theirs, quat)
    assert_allclose(quat_to_matrix(quat).ravel(), theirs, rtol=0, atol=1e-14)
