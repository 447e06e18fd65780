"""The robots this package knows by name, the one in a user's own MJCF, and what that may be told."""

from contactsafe.robot.arm import Arm, arm_from_description
from contactsafe.robot.description import Tip, Tool
from contactsafe.robot.fr3 import FR3
from contactsafe.robot.franka import HAND, WIPER
from contactsafe.robot.panda import PANDA
from contactsafe.robot.user_mjcf import from_mjcf
from contactsafe.robot.wrist import WristNames

__all__ = ["HAND", "WIPER", "Tip", "Tool", "WristNames", "fr3", "from_mjcf", "panda"]


def panda(tool: Tool = WIPER) -> Arm:
    """Give the Franka Emika Panda.

    Args:
        tool: what the flange carries; `WIPER`, a hand with a block of felt, `HAND` alone, or a `Tool` of one's own.
    """
    return arm_from_description(PANDA, tool)


def fr3(tool: Tool = WIPER) -> Arm:
    """Give the Franka Research 3.

    Args:
        tool: what the flange carries; `WIPER`, a hand with a block of felt, `HAND` alone, or a `Tool` of one's own.
    """
    return arm_from_description(FR3, tool)
