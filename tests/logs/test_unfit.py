"""Logs from which nothing can be identified are refused before anything is computed."""

import numpy as np
import pytest

from contactsafe import robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.logs.log import Log
from contactsafe.logs.soundness import refuse_unfit


@pytest.fixture(scope="module")
def arm():
    return robots.panda(None)


def swinging(size, rate_hz=100.0, seconds=4.0, joints=7):
    time = np.arange(0.0, seconds, 1.0 / rate_hz)
    q = size * np.sin(time)[:, None] * np.ones(joints)
    return Log("a log", time, q, torque=np.zeros_like(q))


def test_a_log_of_a_motion_is_taken(arm):
    refuse_unfit(swinging(0.3), arm)


@pytest.mark.parametrize(
    ("log", "text"),
    [
        (swinging(0.3, joints=6), "a log has 6 joints, arm 'panda' has 7; give the right robot"),
        (swinging(0.3, rate_hz=30.0), "a log has 30 rows a second by its time; record 50 to 20000"),
        (
            swinging(0.3, rate_hz=25000.0),
            "has 2.5e+04 rows a second by its time; record 50 to 20000; if they were stamped in bursts as they "
            "arrived, give their rate, --rate HZ",
        ),
        (swinging(0.3, seconds=1.0), "record 2 s or more, better 30, see `contactsafe record`"),
        (swinging(0.01), "is of an arm at rest: no joint moves by more than 0.018 rad"),
    ],
)
def test_what_shows_nothing_is_refused_in_one_line(arm, log, text):
    with pytest.raises(InvalidInputError) as caught:
        refuse_unfit(log, arm)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)
