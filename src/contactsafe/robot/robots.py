"""The robots this package knows by name."""

from contactsafe.robot.arm import Arm, arm_from_facts
from contactsafe.robot.facts import Tool
from contactsafe.robot.panda import HAND, PANDA, WIPING_PAD

__all__ = ["HAND", "WIPING_PAD", "panda"]


def panda(tool: Tool = WIPING_PAD) -> Arm:
    """Give the Franka Emika Panda.

    Args:
        tool: what the flange carries.
    """
    return arm_from_facts(PANDA, tool)
