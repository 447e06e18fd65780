"""Places on the links of Franka's arms that the paper's experiments name: what is met, and where is pushed."""

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm

LINKS = 7
FOREARM = 5

PUSH_POINTS = {4: (-0.0825, 0.12, 0.0), 5: (0.0, 0.0, -0.2), 6: (0.0, 0.0, 0.0)}
"""Where each link is pushed: end of the forearm near the elbow, its middle, the wrist; in the link's frame, m."""


def require_franka_links(arm: Arm) -> None:
    """Refuse an arm whose links these are not.

    Raises:
        InvalidInputError: it has another number of joints.
    """
    if arm.n != LINKS:
        raise InvalidInputError(
            f"arm '{arm.name}' has {arm.n} joints; this experiment names places on the links of an arm of {LINKS}, "
            "such as contactsafe.robots.panda() or fr3()"
        )
