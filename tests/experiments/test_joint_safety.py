"""Where the obstacle is put, for any arm and posture."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.joint_safety import OBSTACLES, forearm, place_before_forearm
from contactsafe.robot import robots
from contactsafe.robot.arm import arm_from_description
from contactsafe.robot.franka import HAND
from contactsafe.robot.panda import PANDA

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
    with pytest.raises(InvalidInputError, match=r"has no description of its links and tool; give contactsafe\.robots"):
        forearm(replace(ARM, description=None), ARM.home)


def test_the_hand_of_a_four_joint_arm_was_taken_for_its_forearm():
    four = arm_from_description(replace(PANDA, links=PANDA.links[:4], home=PANDA.home[:4]), HAND)
    with pytest.raises(InvalidInputError) as error:
        forearm(four, four.home)
    assert str(error.value) == (
        "arm 'panda' has 4 joints; this experiment names places on the links of an arm of 7, such as "
        "contactsafe.robots.panda() or fr3()"
    )
