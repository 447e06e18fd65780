"""The robots this package knows by name, the one in a user's own MJCF, and what that may be told."""

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.robot.arm import Arm, arm_from_description
from contactsafe.robot.calibrated import calibrated
from contactsafe.robot.calibration import Calibration
from contactsafe.robot.description import Tip, Tool
from contactsafe.robot.fr3 import FR3
from contactsafe.robot.franka import FLANGE, HAND, WIPER
from contactsafe.robot.panda import PANDA
from contactsafe.robot.spec_parts import Flange
from contactsafe.robot.torque_driven import make_torque_driven
from contactsafe.robot.urdf_file import urdf_spec
from contactsafe.robot.user_mjcf import ArmOptions, from_mjcf
from contactsafe.robot.user_urdf import from_urdf
from contactsafe.robot.wrist import WristNames

__all__ = [
    "FLANGE", "HAND", "WIPER", "ArmOptions", "Calibration", "Flange", "Tip", "Tool", "WristNames", "calibrated", "fr3",
    "from_mjcf", "from_urdf", "make_torque_driven", "panda", "urdf_spec",
]  # fmt: skip

TOOLS = {"flange": FLANGE, "hand": HAND, "wiper": WIPER}
"""What a Franka's flange may carry, by name."""


def panda(tool: Tool | str | None = WIPER) -> Arm:
    """Give the Franka Emika Panda.

    Args:
        tool: what the flange carries: "wiper", a hand with a block of felt, "hand" alone, None for nothing, or a `Tool`
            of one's own.

    Raises:
        InvalidInputError: no such tool.
    """
    return arm_from_description(PANDA, tool_of(tool))


def fr3(tool: Tool | str | None = WIPER) -> Arm:
    """Give the Franka Research 3; see `panda`."""
    return arm_from_description(FR3, tool_of(tool))


def tool_of(tool: Tool | str | None) -> Tool:
    """Return a tool that was given by its name, as it is, or not at all: the bare flange.

    Raises:
        InvalidInputError: no such tool.
    """
    if tool is None:
        return FLANGE
    if isinstance(tool, Tool):
        return tool
    if not isinstance(tool, str) or tool not in TOOLS:
        raise InvalidInputError(
            f"tool {shown(tool)} is unknown; give one of {', '.join(TOOLS)}, None for a bare flange, or a robots.Tool"
        )
    return TOOLS[tool]
