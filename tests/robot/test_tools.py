"""What a flange carries is named, given, or nothing."""

import numpy as np
import pytest

from contactsafe import robots
from contactsafe.core.errors import InvalidInputError

MAKERS = [robots.panda, robots.fr3]


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize(
    ("given", "tool"),
    [("hand", robots.HAND), ("wiper", robots.WIPER), (None, robots.FLANGE), (robots.HAND, robots.HAND)],
)
def test_a_tool_is_taken_by_name_as_it_is_or_not_at_all(make, given, tool):
    assert make(given).tool is tool


@pytest.mark.parametrize("make", MAKERS)
def test_a_bare_flange_weighs_nothing_and_works_at_its_middle(make):
    bare, hand = make(None), make("hand")
    assert bare.model.body("tool").mass[0] == 0.0
    still = np.zeros(7)
    lighter = hand.dynamics(hand.home, still)["g"] - bare.dynamics(bare.home, still)["g"]
    assert np.abs(lighter).max() > 2.0
    down = np.array([0.0, 0.0, 0.1034])
    np.testing.assert_allclose(bare.tool_pose(bare.home).position - hand.tool_pose(hand.home).position, down, atol=1e-9)


@pytest.mark.parametrize("tool", ["gripper", 3, ("hand",)])
def test_another_name_is_refused_with_those_there_are(tool):
    with pytest.raises(InvalidInputError, match="is unknown; give one of flange, hand, wiper, None"):
        robots.panda(tool)
