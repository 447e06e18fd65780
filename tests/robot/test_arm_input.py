"""Bad numbers are refused at the door, by name, with what is allowed."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from contactsafe.core.errors import ContactSafeError, InvalidInputError
from contactsafe.robot.arm import finite_array


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ([0.0] * 6, "q has shape (6,); give 7 finite numbers"),
        (np.zeros((7, 1)), "q has shape (7, 1); give 7 finite numbers"),
        (1.0, "q has shape (); give 7 finite numbers"),
        ([0, 0, np.nan, 0, 0, 0, 0], "q[2] = nan; every number must be finite"),
        ([0, 0, 0, 0, 0, 0, -np.inf], "q[6] = -inf; every number must be finite"),
        ({"joint1": 0.0}, "q is dict, not numbers; give 7 finite numbers"),
        ("home", "q is str, not numbers; give 7 finite numbers"),
        ([[0.0], [0.0, 1.0]], "q is list, not numbers; give 7 finite numbers"),
    ],
)
def test_joint_vector_says_what_is_wrong(panda, value, text):
    with pytest.raises(InvalidInputError) as caught:
        panda.joint_vector(value, "q")
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("value", "shape", "text"),
    [
        (np.zeros((3, 2)), (2, 3), "x has shape (3, 2); give 2 × 3 finite numbers"),
        ([[0.0, np.inf]], (1, 2), "x[0, 1] = inf; every number must be finite"),
        (np.nan, (), "x = nan; every number must be finite"),
        ([1.0], (), "x has shape (1,); give one finite number"),
    ],
)
def test_finite_array_says_what_is_wrong(value, shape, text):
    with pytest.raises(InvalidInputError) as caught:
        finite_array(value, shape, "x")
    assert str(caught.value) == text


def test_one_family_of_errors():
    assert issubclass(InvalidInputError, ContactSafeError)
    assert issubclass(InvalidInputError, ValueError)


def test_what_is_given_is_copied_not_kept(panda):
    mine = np.zeros(7)
    checked = panda.joint_vector(mine, "q")
    checked[0] = 1.0
    assert_array_equal(mine, 0.0)
    assert_array_equal(panda.joint_vector((0, 1, 2, 3, 4, 5, 6), "q"), np.arange(7.0))


def test_tool_pose_and_dynamics_check_their_input(panda):
    with pytest.raises(InvalidInputError, match=r"^q has shape \(2,\)"):
        panda.tool_pose([0.0, 0.0])
    with pytest.raises(InvalidInputError, match=r"^qd has shape \(2,\)"):
        panda.dynamics(panda.home, [0.0, 0.0])


def test_arm_says_which_it_is_in_one_line(panda):
    assert repr(panda) == "Arm('panda', 7 joints, tool point 'tcp')"
