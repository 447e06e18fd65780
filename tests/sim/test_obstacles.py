"""Obstacles that no engine could carry are refused when they are described."""

import math

import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.obstacles import Obstacle, bottle, thrust_meter

AT = (0.5, 0.0, 0.3)


@pytest.mark.parametrize("make", [bottle, thrust_meter])
def test_known_ones_stand_where_they_are_put_and_can_move(make):
    assert make(AT).position == AT
    assert not make(AT).fixed


def test_only_infinite_stiffness_is_fixed():
    assert Obstacle(AT, 0.03, math.inf).fixed
    assert not Obstacle(AT, 0.03, 1e9).fixed


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"mass": 0.09}, "obstacle mass = 0.09 kg; give 0.1 kg or more"),
        ({"radius": 0.0}, "both must be greater than 0"),
        ({"stiffness": -1.0}, "both must be greater than 0"),
        ({"travel_until_n": 0.0}, "give a force above 0, or inf"),
        ({"travel_until_n": math.nan}, "give a force above 0, or inf"),
        ({"travel": (0.1, 0.0, 0.0), "stiffness": math.inf}, "give a finite stiffness"),
        ({"travel": (0.1, 0.0, 0.0), "travel_s": (1.0, 1.0)}, "a time of arrival after that of departure"),
    ],
)
def test_what_cannot_be_is_refused(fields, told):
    with pytest.raises(InvalidInputError) as caught:
        Obstacle(**{"position": AT, "radius": 0.03, "stiffness": 1e4, **fields})
    assert told in str(caught.value)
