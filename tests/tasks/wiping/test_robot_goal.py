"""One piece of ink at a time."""

import numpy as np
import pytest

pytest.importorskip("cv2")

from contactsafe.tasks.wiping.robot_goal import Goal

TOOL = np.array([20.5, 20.5])  # column, row


def mask_with(*places):
    """Return a mask with ink at row, column, height, width of each."""
    mask = np.full((64, 64), 255, np.uint8)
    for row, column, height, width in places:
        mask[row : row + height, column : column + width] = 0
    return mask


NEAR, FAR, SPECK = (30, 20, 3, 6), (10, 50, 3, 6), (20, 22, 1, 1)


def test_all_is_shown_while_something_gets_done():
    mask = mask_with(NEAR, FAR)
    assert Goal().show(mask, mask == 0, TOOL, False) is mask


def test_a_piece_stays_the_goal_until_it_is_seen_to_be_gone():
    """The tool that wipes it hides it: the other piece must not become the nearest."""
    goal, both = Goal(), mask_with(NEAR, FAR)
    shown = goal.show(both, both == 0, TOOL, True)
    assert (shown == mask_with(NEAR)).all()
    hidden = goal.show(mask_with(FAR), both == 0, TOOL, False)
    assert (hidden == 255).all()
    assert (goal.show(both, both == 0, TOOL, False) == mask_with(NEAR)).all()
    gone = mask_with(FAR)
    assert (goal.show(gone, gone == 0, TOOL, False) == gone).all()


def test_a_speck_beside_the_tool_is_the_goal_only_where_nothing_else_is():
    mask, speck = mask_with(SPECK, FAR), mask_with(SPECK)
    assert (Goal().show(mask, mask == 0, TOOL, True) == mask_with(FAR)).all()
    assert (Goal().show(speck, speck == 0, TOOL, True) == speck).all()


def test_without_ink_there_is_no_goal():
    mask = mask_with()
    assert (Goal().show(mask, mask == 0, TOOL, True) == 255).all()


@pytest.mark.parametrize("apart", [5, 6])
def test_strokes_of_a_letter_are_one_piece(apart):
    mask = mask_with((30, 20, 3, 3), (30, 22 + apart, 3, 3))
    shown = Goal().show(mask, mask == 0, TOOL, True)
    assert (shown == mask).all() == (apart == 5)
