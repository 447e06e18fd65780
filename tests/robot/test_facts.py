"""Facts that a real machine could have."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe.robot.facts import Inertia
from contactsafe.robot.panda import HAND, PANDA, WIPING_PAD

BODIES = {
    "base": PANDA.base,
    **{f"link{index}": link.inertia for index, link in enumerate(PANDA.links, start=1)},
    "hand": HAND.inertia,
    "pad": WIPING_PAD.inertia,
}


@pytest.mark.parametrize("name", BODIES)
def test_such_a_body_can_exist(name):
    """Mass positive; no principal moment exceeds the sum of the other two."""
    inertia = BODIES[name]
    moments = np.linalg.eigvalsh(inertia.matrix())
    assert inertia.mass > 0
    assert moments[0] > 0
    assert moments[2] <= moments[0] + moments[1]


def test_limits_are_in_order_and_home_is_well_inside():
    q_min, q_max, home = PANDA.joint_array("q_min"), PANDA.joint_array("q_max"), np.array(PANDA.home)
    assert np.all(q_min + 0.5 < home)
    assert np.all(home < q_max - 0.5)
    for field in ("qd_max", "tau_max", "armature"):
        assert np.all(PANDA.joint_array(field) > 0)


@pytest.mark.parametrize("link", PANDA.links)
def test_frames_are_turned_by_unit_quaternions(link):
    assert_allclose(np.linalg.norm(link.quat), 1, rtol=0, atol=1e-12)


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
    assert WIPING_PAD.inertia.mass == pytest.approx(HAND.inertia.mass + 0.1)
