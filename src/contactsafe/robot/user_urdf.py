"""The arm inside a user's own URDF: read by MuJoCo without its pictures, and then as an MJCF is."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.robot.arm import Arm
from contactsafe.robot.description import Tip
from contactsafe.robot.user_mjcf import from_mjcf

_MOTOR = "{}_motor"


def from_urdf(
    path: str | os.PathLike,
    link: str,
    joints: Sequence[str] | None = None,
    *,
    tau_max: ArrayLike | None = None,
    torque_rate_max: float | None = None,
    friction: ArrayLike | None = None,
    home: ArrayLike | None = None,
    tip: Tip | None = None,
) -> Arm:
    """Return the arm inside a user's own URDF.

    Masses, joints and their limits are the file's; meshes and what is only seen are left out. A joint with
    `<dynamics>` has those left out too, as in `from_mjcf`, and a URDF has no rotors: identify both.

    Args:
        path: of the URDF.
        link: whose frame is the end-effector point.
        joints: names of the arm's revolute joints from base to tip; None for all that move the link.
        tau_max: torque limits, (n,), N m; None for the file's `effort`.
        torque_rate_max, friction, home, tip: as of `from_mjcf`.

    Raises:
        InvalidInputError: the file cannot be read, has no such link, or what `from_mjcf` says.
    """
    root = _robot(path)  # joints and links are its children: <transmission> and <ros2_control> have others
    names = [one.get("name", "") for one in root.findall("link")]
    if link not in names:
        raise InvalidInputError(f"{os.fspath(path)} has no link {shown(link)}; give one of {', '.join(names)}")
    site = link if link not in {joint.get("name") for joint in root.findall("joint")} else f"{link}_frame"
    arm = from_mjcf(
        _model(path, root, link, site),
        site,
        joints,
        tau_max=tau_max,
        torque_rate_max=torque_rate_max,
        friction=friction,
        home=home,
        tip=tip,
    )
    speeds = {joint.get("name"): _limit(joint, "velocity") for joint in root.findall("joint")}
    fastest = [speeds.get(arm.model.joint(i).name, np.inf) for i in range(arm.n)]
    return replace(arm, qd_max=np.array([speed if speed > 0.0 else np.inf for speed in fastest]))


def _robot(path: str | os.PathLike) -> ET.Element:
    """Read a URDF, without meshes and what is only seen."""
    try:
        root = ET.parse(path).getroot()
    except (OSError, ET.ParseError) as error:
        raise InvalidInputError(f"{os.fspath(path)} is no URDF that can be read: {error}; give its path") from None
    if root.tag != "robot":
        raise InvalidInputError(f"{os.fspath(path)} has no <robot>; give a URDF")
    for one in root.findall("link"):
        for part in one.findall("visual") + one.findall("collision"):
            if part.tag == "visual" or part.find("geometry/mesh") is not None:
                one.remove(part)
    for extension in root.findall("mujoco"):
        root.remove(extension)
    compiler = ET.SubElement(ET.SubElement(root, "mujoco"), "compiler")
    compiler.attrib.update(fusestatic="false", balanceinertia="true", boundmass="1e-9", boundinertia="1e-12")
    return root


def _model(path: str | os.PathLike, root: ET.Element, link: str, site: str) -> mujoco.MjModel:
    try:
        spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
        body = spec.body(link) or spec.worldbody  # the root link is the world
        body.add_site(name=site)
        for joint in root.findall("joint"):
            effort, name = _limit(joint, "effort"), joint.get("name", "")
            if joint.get("type") in ("revolute", "continuous") and effort > 0.0:
                motor = spec.add_actuator(name=_MOTOR.format(name), target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
                motor.set_to_motor()
                if np.isfinite(effort):
                    motor.ctrllimited, motor.ctrlrange = True, (-effort, effort)
        return spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InvalidInputError(f"MuJoCo cannot read '{os.fspath(path)}': {reason}; mend the file") from None


def _limit(joint: ET.Element, name: str) -> float:
    limit = joint.find("limit")
    try:
        return float("inf" if limit is None else limit.get(name, "inf"))
    except ValueError:
        return np.inf
