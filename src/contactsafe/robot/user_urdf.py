"""The arm inside a user's own URDF: read by MuJoCo without its pictures, and then as an MJCF is."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from contactsafe.robot.arm import Arm
from contactsafe.robot.findings import Findings
from contactsafe.robot.names import SITE, find
from contactsafe.robot.spec_parts import compiled_spec
from contactsafe.robot.urdf_file import limit_of, read_urdf, robot_of
from contactsafe.robot.user_mjcf import ArmOptions, arm_in, refuse_options


def from_urdf(
    path: str | os.PathLike,
    link: str | None = None,
    joints: Sequence[str] | None = None,
    **options: Unpack[ArmOptions],
) -> Arm:
    """Return the arm inside a user's own URDF.

    Masses, joints, their limits of torque (`effort`) and speed (`velocity`), damping and friction of `<dynamics>` are
    the file's; what is only seen is left out. A URDF has no rotors: identify them. `urdf_spec` gives the same as a
    scene to simulate.

    Args:
        path: of the URDF.
        link: whose frame is the end-effector point; without it the error names those that there are.
        joints: names of the arm's revolute joints from base to tip; None for all that move the link.
        **options: as of `from_mjcf`; `actuators` makes no difference.

    Raises:
        InvalidInputError: the file cannot be read, has no such link, or what `from_mjcf` says.
    """
    refuse_options(options)
    findings = Findings()
    spec, site = read_urdf(path, link, findings)
    model = compiled_spec(spec, f"'{os.fspath(path)}'")
    arm = arm_in(model, find(model, SITE, site), joints, options, findings)
    speeds = {joint.get("name"): limit_of(joint, "velocity") for joint in robot_of(path).findall("joint")}
    fastest = [speeds.get(arm.model.joint(i).name, np.inf) for i in range(arm.n)]
    return replace(arm, qd_max=np.array([speed if speed > 0.0 else np.inf for speed in fastest]))
