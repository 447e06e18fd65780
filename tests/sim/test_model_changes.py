"""What changes in a world's model: only its own, only what is there, and part of the world's state."""

import numpy as np
import pytest
from tests.sim.scenes import panda

from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.fixtures import workbench
from contactsafe.sim.worlds import Worlds

FURNISHED = WorldConfig(fixtures=(workbench(),))
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def own():
    """Two worlds with a model each."""
    worlds = Worlds(panda(), FURNISHED, n=2, seed=0, shared=False)
    yield worlds
    worlds.close()


def refusal(call, *arguments):
    with pytest.raises(InvalidInputError) as caught:
        call(*arguments)
    return str(caught.value)


def test_a_fixture_was_moved_in_all_worlds_that_share_a_model():
    worlds = Worlds(panda(), FURNISHED, n=3, seed=0)
    told = (
        "the model of world 1 is to change, but 2 other worlds use it; make Worlds(..., shared=False), or declare "
        "`varies = True` in the task"
    )
    assert refusal(worlds.place_fixture, 1, "workbench", (0.5, 0.0, 0.1), UPRIGHT) == told
    assert refusal(worlds.set_tip_friction, 1, 0.5) == told
    worlds.close()


def test_what_is_not_there_or_no_place_is_told(own):
    place = own.place_fixture
    assert refusal(place, 0, "blok", (0.5, 0.0, 0.1), UPRIGHT) == "fixture 'blok' is unknown; this world has workbench"
    assert "fixture 'link1' is unknown" in refusal(place, 0, "link1", (0.5, 0.0, 0.1), UPRIGHT)
    assert "position has shape (2,)" in refusal(place, 0, "workbench", (0.5, 0.0), UPRIGHT)
    assert "quat has length 2" in refusal(place, 0, "workbench", (0.5, 0.0, 0.1), (2.0, 0.0, 0.0, 0.0))
    assert refusal(own.set_tip_friction, 0, -0.1) == "friction = -0.1; give 0 to 10"
    assert "friction" in refusal(own.set_tip_friction, 0, np.nan)


def test_what_cannot_be_pushed_is_told(own):
    push = own.push
    told = "body 'elbow' cannot be pushed; choose link1 to link7, or tool"
    assert refusal(push, 0, "elbow", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0, 1.0) == told
    assert "cannot be pushed" in refusal(push, 0, "workbench", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0, 1.0)
    assert "force has shape (2,)" in refusal(push, 0, "link4", (0.0, 0.0, 0.0), (1.0, 0.0), 0.0, 1.0)
    assert not own.records[0]["push"]["body"]


def test_a_change_is_one_worlds_own_and_is_loaded_with_its_state(own):
    own.place_fixture(0, "workbench", (0.5, 0.0, 0.1), UPRIGHT)
    own.set_tip_friction(0, 0.7)
    other = Worlds(panda(), FURNISHED, n=2, seed=1, shared=False)
    other.load_state_dict(own.state_dict())
    for worlds in (own, other):
        heights = [model.body("workbench").pos[2] for model in worlds.models]
        assert heights == [0.1, 0.01]
        assert [model.geom("tip").friction[0] for model in worlds.models] == [0.7, 0.3]
    other.close()


def test_a_state_whose_fixture_is_nowhere_is_refused(own):
    state = own.state_dict()
    state["physics"][1]["body_pos"][1] = np.nan
    assert "physics.body_pos" in refusal(own.load_state_dict, state)
