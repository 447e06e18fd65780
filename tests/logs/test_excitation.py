"""A proposed motion begins and ends at home and keeps to every limit, off the arm itself and above the floor."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.robot.worlds import ELBOW

from contactsafe import robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.logs.clearance import Clearance, segment_distance
from contactsafe.logs.excitation import excitation
from contactsafe.robot.regressor import motion_of, nominal_terms
from contactsafe.robot.shape import arm_capsules


@pytest.fixture(scope="module")
def arm():
    return robots.panda("hand")


@pytest.fixture(scope="module")
def motion(arm):
    return excitation(arm, 10.0, 200.0, seed=3, floor_m=0.1)


def test_it_begins_and_ends_at_home_at_rest(arm, motion):
    for row in (0, -1):
        assert_allclose(motion.q[row], arm.home)
        assert_allclose(motion.qd[row], 0.0)


def test_velocity_is_that_of_the_positions(motion):
    assert_allclose(np.gradient(motion.q, motion.time, axis=0)[2:-2], motion.qd[2:-2], atol=1e-3)


def test_limits_of_position_speed_and_torque_hold(arm, motion):
    assert (motion.q > arm.q_min).all()
    assert (motion.q < arm.q_max).all()
    assert (np.abs(motion.qd) <= 0.65 * arm.qd_max).all()
    p, beta = nominal_terms(arm, motion_of(arm, motion.q, motion.qd), motion.qd, rotors=True)
    assert (np.abs(np.gradient(p, motion.time, axis=0) + beta) < 0.8 * arm.tau_max).all()


def test_every_joint_moves_to_and_fro(motion):
    assert (np.ptp(motion.q, axis=0) > 0.2).all()
    assert (motion.qd.min(axis=0) < -0.1).all()
    assert (motion.qd.max(axis=0) > 0.1).all()


def test_it_stays_above_the_floor_and_off_itself(arm, motion):
    assert Clearance(arm, 0.1).is_free(motion.q[::5])
    starts, ends, radii, owners = arm_capsules(arm.description, arm.tool, motion.q[::5])
    lowest = np.minimum(starts[..., 2], ends[..., 2]) - radii
    assert (lowest[:, owners >= 2] > 0.1).all()


def test_an_arm_folded_into_itself_is_not_free(arm):
    folded = np.array([0.0, -1.7, 0.0, -3.05, 0.0, 0.0, 0.0])
    assert not Clearance(arm).is_free(folded[None])
    assert not Clearance(arm, 0.5).is_free(arm.home[None])


def test_a_seed_gives_the_same_motion_again(arm, motion):
    again = excitation(arm, 10.0, 200.0, seed=3, floor_m=0.1)
    np.testing.assert_array_equal(again.q, motion.q)


def test_joints_without_limits_move_too(tmp_path):
    path = tmp_path / "elbow.xml"
    path.write_text(ELBOW, encoding="utf-8")
    arm = robots.from_mjcf(str(path), "tip")
    found = excitation(arm, 6.0, 100.0)
    assert (np.ptp(found.q, axis=0) > 0.1).all()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"seconds": 1.0}, "seconds = 1; give 5 to 600"),
        ({"rate_hz": 10.0}, "rate = 10; give 50 to 2000"),
        ({"floor_m": 2.0}, "has no room to move about its home"),
    ],
)
def test_what_cannot_be_is_refused(arm, options, text):
    with pytest.raises(InvalidInputError, match=text):
        excitation(arm, **{"seconds": 6.0, **options})


def test_distances_of_segments_by_hand():
    def at(*points):
        return segment_distance(*(np.array([point], dtype=float) for point in points))[0]

    assert at((0, 0, 0), (1, 0, 0), (0, 2, 0), (1, 2, 0)) == pytest.approx(2.0)  # parallel
    assert at((0, 0, 0), (1, 0, 0), (0.5, -1, 1), (0.5, 1, 1)) == pytest.approx(1.0)  # crossing
    assert at((0, 0, 0), (1, 0, 0), (3, 0, 0), (4, 0, 0)) == pytest.approx(2.0)  # in line
    assert at((0, 0, 0), (0, 0, 0), (0, 3, 4), (0, 3, 4)) == pytest.approx(5.0)  # points
