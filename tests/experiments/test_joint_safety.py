"""Where the obstacle is put, for any arm and posture."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.joint_safety import OBSTACLES, forearm, place_before_forearm
from contactsafe.robot import robots

ARM = robots.panda()


@given(st.integers(0, 1000), st.sampled_from(sorted(OBSTACLES)))
def test_it_touches_the_forearms_middle_from_the_right(seed, name):
    q = np.random.default_rng(seed).uniform(ARM.q_min, ARM.q_max)
    make = OBSTACLES[name]
    middle, radius = forearm(ARM, q)
    x, y, z = place_before_forearm(ARM, q, make)
    assert (x, z) == (middle[0], middle[2])
    assert middle[1] - y == pytest.approx(radius + make((0.0, 0.0, 0.0)).radius)


def test_an_arm_without_description_has_no_forearm():
    with pytest.raises(InvalidInputError, match=r"has no description to know its forearm by; give contactsafe\.robots"):
        forearm(replace(ARM, description=None), ARM.home)
