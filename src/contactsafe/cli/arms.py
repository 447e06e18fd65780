"""Robots as commands name them, with what was identified of them."""

from pathlib import Path
from typing import Annotated

import tyro

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm
from contactsafe.robot.calibration import Calibration

KNOWN = {"panda": robots.panda, "fr3": robots.fr3}
"""Robots by name; any other is the path of an MJCF or URDF file."""

CalibrationFile = Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: none)")]


def arm_of(robot: str, tool: str, site: str | None, calibration: Path | None = None) -> Arm:
    """Return the arm that words name.

    Args:
        robot: one of `KNOWN`, or the path of an MJCF or URDF file.
        tool: what a Franka's flange carries.
        site: end-effector point of an MJCF, or link of a URDF.
        calibration: file of what was identified of it.

    Raises:
        InvalidInputError: there is no such robot, tool, site or calibration.
    """
    arm = _described(robot, tool, site)
    return arm if calibration is None else robots.calibrated(arm, calibration)


def load_calibration(path: Path | None) -> Calibration | None:
    """Return what was identified of the robot of a task or an experiment, None where no file is named.

    Raises:
        InvalidInputError: it is no calibration.
    """
    return None if path is None else Calibration.load(path)


def _described(robot: str, tool: str, site: str | None) -> Arm:
    if robot in KNOWN:
        if site is not None:
            raise InvalidInputError(f"site = {shown(site)} is for an MJCF or URDF file; leave it out for {robot}")
        return KNOWN[robot](tool)
    path = Path(robot)
    if not path.exists():
        raise InvalidInputError(f"robot {shown(robot)} is neither {', '.join(KNOWN)} nor a file; give its MJCF or URDF")
    if site is None:
        raise InvalidInputError(f"{path.name} has end-effector points of its own; say which, --site NAME")
    if path.suffix.lower() == ".urdf":
        return robots.from_urdf(str(path), site)
    return robots.from_mjcf(str(path), site, actuators="torque")  # with servos too: nothing is driven here
