"""Descriptions that a real machine could have."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.description import Inertia, Tip
from contactsafe.robot.fr3 import FR3
from contactsafe.robot.franka import HAND, WIPER
from contactsafe.robot.panda import PANDA

ARMS = pytest.mark.parametrize("description", [PANDA, FR3], ids=lambda description: description.name)
BODIES = {"hand": HAND.inertia, "wiper": WIPER.inertia}
for arm in (PANDA, FR3):
    BODIES |= {f"{arm.name} base": arm.base}
    BODIES |= {f"{arm.name} link{index}": link.inertia for index, link in enumerate(arm.links, start=1)}


@pytest.mark.parametrize("name", BODIES)
def test_such_a_body_can_exist(name):
    """Mass positive; no principal moment exceeds the sum of the other two."""
    inertia = BODIES[name]
    moments = np.linalg.eigvalsh(inertia.matrix())
    assert inertia.mass > 0
    assert moments[0] > 0
    assert moments[2] <= moments[0] + moments[1]


@ARMS
def test_limits_are_in_order_and_home_is_well_inside(description):
    q_min, q_max, home = description.joint_array("q_min"), description.joint_array("q_max"), np.array(description.home)
    assert np.all(q_min + 0.5 < home)
    assert np.all(home < q_max - 0.5)
    for field in ("qd_max", "tau_max", "armature"):
        assert np.all(description.joint_array(field) > 0)


@pytest.mark.parametrize("link", PANDA.links)
def test_frames_are_turned_by_unit_quaternions(link):
    assert_allclose(np.linalg.norm(link.quat), 1, rtol=0, atol=1e-12)


@ARMS
def test_mass_is_that_of_an_arm_of_this_size(description):
    """The published weight is about 18 kg, base included."""
    assert 16 < description.base.mass + sum(link.inertia.mass for link in description.links) < 19


def test_both_generations_stand_alike():
    """One drawing serves both: frames and shape are the same, masses and limits are not."""
    for panda, fr3 in zip(PANDA.links, FR3.links, strict=True):
        assert (panda.position, panda.quat, panda.capsules) == (fr3.position, fr3.quat, fr3.capsules)
        assert panda.inertia != fr3.inertia
        assert panda.joint.tau_max == fr3.joint.tau_max


def test_joined_bodies_keep_mass_and_centre_and_do_not_care_for_order():
    a = Inertia(1.0, (0.1, 0.0, 0.0), (0.01, 0.02, 0.02, 0.0, 0.0, 0.0))
    b = Inertia(3.0, (0.0, 0.2, 0.0), (0.02, 0.02, 0.03, 0.001, 0.0, 0.0))
    joined = a + b
    assert joined.mass == 4.0
    assert_allclose(joined.com, (0.025, 0.15, 0.0))
    assert_allclose(joined.matrix(), (b + a).matrix())


def test_two_points_make_a_dumbbell():
    """Masses m at ±r turn with 2 m r² about the middle, and with nothing about the bar."""
    point = (0.0,) * 6
    dumbbell = Inertia(0.5, (0.0, 0.0, 0.3), point) + Inertia(0.5, (0.0, 0.0, -0.3), point)
    assert_allclose(dumbbell.tensor, (0.09, 0.09, 0.0, 0.0, 0.0, 0.0), atol=1e-16)


def test_the_pad_hangs_on_the_hand():
    assert WIPER.inertia.mass == pytest.approx(HAND.inertia.mass + 0.1)


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (((0.01, 0.01, 0.03), "sphere"), "tip shape = 'sphere'; choose box or cylinder"),
        (((0.01, 0.0, 0.03),), "tip half_size = (0.01, 0.0, 0.03); give three lengths greater than 0, m"),
        (((0.01, 0.03),), "tip half_size = (0.01, 0.03); give three lengths greater than 0, m"),
        (
            ((0.01, 0.03, 0.03), "cylinder"),
            "tip half_size = (0.01, 0.03, 0.03); give a cylinder its radius twice, then half its length, m",
        ),
    ],
)
def test_tips_that_cannot_be_are_refused(made, told):
    with pytest.raises(InvalidInputError) as error:
        Tip(*made)
    assert str(error.value) == told
