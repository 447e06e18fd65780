"""What an arm is: description of each robot, models generated from them, nominal dynamics, inverse kinematics."""

from contactsafe.robot.arm import Arm, Pose
from contactsafe.robot.description import ArmDescription, Tip, Tool
from contactsafe.robot.payload import Payload, carrying
from contactsafe.robot.shape import arm_capsules, link_frames, tip_corners

__all__ = [
    "Arm",
    "ArmDescription",
    "Payload",
    "Pose",
    "Tip",
    "Tool",
    "arm_capsules",
    "carrying",
    "link_frames",
    "tip_corners",
]
