"""Conditions of a policy: names that exist, and answers that are yes or no."""

import pytest

from contactsafe.control import presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.action_config import GAINS
from contactsafe.policy.conditions import Conditions


@pytest.mark.parametrize("controller", presets.PRESETS)
@pytest.mark.parametrize("gains", GAINS)
def test_every_preset_goes_with_all_gains(controller, gains):
    conditions = Conditions(controller, gains, as_paper=True)
    assert (conditions.controller, conditions.gains, conditions.as_paper) == (controller, gains, True)


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"controller": "gentle"}, "controller 'gentle' is unknown; choose from vices, paper, safe"),
        ({"controller": "safe:gentle=1"}, "parameter 'gentle' is unknown; choose from dt"),
        ({"controller": None}, "controller = None; choose from"),
        ({"gains": "most"}, "gains = 'most'; choose from learned, low, middle, high"),
        ({"gains": ["low"]}, "gains = "),
        ({"as_paper": 1}, "as_paper = 1; give true or false"),
    ],
)
def test_what_cannot_be_is_refused(fields, told):
    with pytest.raises(InvalidInputError) as caught:
        Conditions(**fields)
    assert str(caught.value).startswith(told)
