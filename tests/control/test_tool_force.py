"""What the tool may press with: more against what has worked on the arm, but only where no sensor tells the tool's."""

import pytest
from tests.control.plant import controller_at

from contactsafe import presets
from contactsafe.control.tool_force import follow_tool_limit
from contactsafe.core.compiled import compiled

SAFE = presets.safe()
USUAL, RESISTED = SAFE.reaction.tool_force_limit_n, SAFE.reaction.reject_force_n


@compiled
def _limit(c):
    state, contact_n = c.state, c.params.classification.tool_contact_n
    return follow_tool_limit(state.tool_wrench, state.arm, state.contact_work, contact_n, c.params.reaction)


@pytest.fixture
def limit(panda):
    controller = controller_at(panda, SAFE)
    state = controller.record["state"]

    def after(force_n, taken_j, has_wrench=0):
        state["tool_wrench"]["force"][:] = 0.0, 0.0, -force_n
        state["contact_work"]["taken_j"], state["arm"]["has_wrench"] = taken_j, has_wrench
        return _limit(controller.record)

    return after


def test_what_the_tool_runs_into_is_pressed_with_the_usual_bound(limit):
    assert limit(25.0, 0.1) == USUAL


def test_what_works_on_the_arm_is_resisted_as_a_push_until_it_goes(limit):
    assert limit(25.0, -0.01) == RESISTED
    assert limit(25.0, 0.0) == RESISTED  # it holds still
    assert limit(1.0, 0.0) == USUAL
    assert limit(25.0, 0.0) == USUAL


def test_what_takes_work_after_all_is_pressed_with_the_usual_bound_again(limit):
    assert limit(25.0, -0.01) == RESISTED
    assert limit(25.0, 0.05) == USUAL


def test_with_a_sensor_the_bound_is_the_usual_one(limit):
    assert limit(25.0, -0.01, has_wrench=1) == USUAL
