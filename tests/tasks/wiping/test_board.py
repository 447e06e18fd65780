"""Boards and cameras that cannot be failed somewhere in a task; they are refused when they are made."""

import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot import robots
from contactsafe.tasks.wiping.board import BoardConfig, Camera, pad_half

SIZES = "give a cell greater than 0 m, an ink_size of at least one cell, and edges of at least ink_size"
REFUSED = {
    "no cell": (BoardConfig, {"cell": 0.0}, f"board size = (0.5, 0.6), ink_size = 0.3, cell = 0.0; {SIZES}"),
    "more ink than board": (
        BoardConfig, {"size": (0.2, 0.6)}, f"board size = (0.2, 0.6), ink_size = 0.3, cell = 0.002; {SIZES}"
    ),
    "no number": (
        BoardConfig, {"ink_size": float("nan")}, f"board size = (0.5, 0.6), ink_size = nan, cell = 0.002; {SIZES}"
    ),
    "friction": (
        BoardConfig, {"friction": -0.1},
        "board friction = -0.1, press_n = 0.5; give a friction of 0 to 10, and a force of 0 N or more",
    ),
    "no pixels": (
        Camera, {"size": 0},
        "camera size = 0, focal_px = 180.0; give 1 to 4096 whole pixels, and a focal length greater than 0",
    ),
    "straight above": (
        Camera, {"position": (0.5, 0.0, 0.9)},
        "camera position = (0.5, 0.0, 0.9) is straight above or below its target (0.5, 0.0, 0.01), or no number; move "
        "it aside: its picture stands upright",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_boards_and_cameras_that_cannot_be_are_refused_in_one_line(name):
    kind, fields, told = REFUSED[name]
    with pytest.raises(InvalidInputError) as error:
        kind(**fields)
    assert str(error.value) == told


def test_the_pad_is_the_tip_of_the_tool():
    arm = robots.panda()
    assert pad_half(arm) == arm.tool.tip.half_size
    with pytest.raises(InvalidInputError, match=r"^arm 'panda' has no tip, and task 'wiping' needs a box; give it"):
        pad_half(robots.panda(robots.HAND))
