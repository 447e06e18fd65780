"""The tip of an arm's tool, of the shape that a task works with."""

from typing import Literal

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm
from contactsafe.robot.description import Tip


def tip_of(arm: Arm, shape: Literal["box", "cylinder"], task: str, remedy: str) -> Tip:
    """Return the tip of an arm's tool.

    Args:
        arm: that works.
        shape: that the task needs.
        task: name of the task.
        remedy: a tool that has such a tip.

    Raises:
        InvalidInputError: it has none, or one of another shape.
    """
    tip = None if arm.tool is None else arm.tool.tip
    if tip is None or tip.shape != shape:
        found = "no tip" if tip is None else f"a {tip.shape} for a tip"
        example = "robots.Tip((0.02, 0.02, 0.01))" if shape == "box" else 'robots.Tip((0.01, 0.01, 0.03), "cylinder")'
        raise InvalidInputError(
            f"arm '{arm.name}' has {found}, and task '{task}' needs a {shape}; give it the tool {remedy}, or "
            f"robots.from_mjcf(..., tip={example})"
        )
    return tip
