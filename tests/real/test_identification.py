"""A real Panda's free motion: what its first half shows makes the residual of the second one much smaller."""

import numpy as np
import pytest

from contactsafe import robots
from contactsafe.logs.identification import identify
from contactsafe.logs.log import Log
from contactsafe.logs.replay import replay
from tests.real import recordings

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(
        recordings.folder() is None,
        reason="no recordings of a real Panda here; CONTACTSAFE_REAL_DATA names the folder that has them",
    ),
]


def part(first, last):
    """Return a part of the free motion as a log, from and to as fractions of it."""
    time, q, qd, torque, _ = recordings.free_motion()
    rows = slice(int(first * len(time)), int(last * len(time)))
    return Log("free motion", time[rows], q[rows], qd[rows], torque[rows])


@pytest.fixture(scope="module")
def arm():
    return robots.panda(None)


def test_the_second_half_is_better_by_a_third_and_no_joint_worse(arm):
    found = identify(part(0.0, 1.0), arm)
    assert found.reduction >= 0.3
    assert (found.after < 1.02 * found.before).all()
    assert found.calibration.payload is None  # the flange carried nothing


def test_the_estimator_that_was_told_leaves_less_of_the_half_it_has_not_seen(arm):
    told = robots.calibrated(arm, identify(part(0.0, 0.5), arm).calibration)
    left = []
    for one in (arm, told):
        played = replay(part(0.5, 1.0), one)
        assert not played.touches
        left.append(np.sqrt(np.mean(played.residual**2)))
    assert left[1] <= 0.7 * left[0]
