"""URDF generated from an arm's description, for tools that do not read MJCF: Pinocchio, TRAC-IK, RViz, MoveIt."""

import math
import xml.etree.ElementTree as ET

import numpy as np

from contactsafe.core.rotation import quat_to_matrix
from contactsafe.robot.description import ArmDescription, Capsule, Inertia, Joint, Tool
from contactsafe.robot.mjcf import numbers

BASE_LINK = "base"
TIP_LINK = "tcp"
_FAST = 1e3  # rad/s; URDF knows no infinity
_UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def arm_urdf(description: ArmDescription, tool: Tool) -> str:
    """Write the arm with its tool, base frame at the origin.

    Links are `link0` … `link<n>` and `tool`, and the frames without mass `base`, the root, and `tcp`; joints are
    `joint1` … `joint<n>`, and the fixed `base_mount`, `tool_mount` and `tcp_mount`. URDF has no capsule, so each is a
    cylinder and two spheres. URDF has no tag for rotor inertia either: add `description.joint_array("armature")` to the
    diagonal of an inertia matrix computed from this text, or it will not be the MJCF's. Joint friction is left out
    too, for URDF's model of it is another one.

    Args:
        description: the arm.
        tool: what its flange carries.

    Returns:
        XML text; lengths in m, angles in rad, masses in kg.
    """
    robot = ET.Element("robot", name=description.name)
    ET.SubElement(robot, "link", name=BASE_LINK)  # KDL, under TRAC-IK, takes no root link with mass
    _link(robot, "link0", description.base, description.base_capsules)
    _joint(robot, "base_mount", "fixed", (BASE_LINK, "link0"), (0.0, 0.0, 0.0), _UPRIGHT)
    for index, link in enumerate(description.links, start=1):
        _link(robot, f"link{index}", link.inertia, link.capsules)
        kind = "revolute" if math.isfinite(link.joint.q_min) else "continuous"
        joint = _joint(robot, f"joint{index}", kind, (f"link{index - 1}", f"link{index}"), link.position, link.quat)
        ET.SubElement(joint, "axis", xyz="0 0 1")
        _limit(joint, link.joint)
    mount = _link(robot, "tool", tool.inertia, tool.capsules)
    if tool.tip is not None:
        half_size = tool.tip.half_size
        centre = (tool.tcp[0], tool.tcp[1], tool.tcp[2] - half_size[2])
        size = {"size": numbers(2 * half for half in half_size)}
        if tool.tip.shape == "cylinder":
            size = {"radius": numbers([half_size[0]]), "length": numbers([2 * half_size[2]])}
        _collision(mount, centre, (0.0, 0.0, 0.0), tool.tip.shape, **size)
    _joint(
        robot,
        "tool_mount",
        "fixed",
        (f"link{len(description.links)}", "tool"),
        description.mount_position,
        description.mount_quat,
    )
    ET.SubElement(robot, "link", name=TIP_LINK)
    _joint(robot, "tcp_mount", "fixed", ("tool", TIP_LINK), tool.tcp, _UPRIGHT)
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode")


def _link(robot: ET.Element, name: str, inertia: Inertia, capsules: tuple[Capsule, ...]) -> ET.Element:
    link = ET.SubElement(robot, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    _origin(inertial, inertia.com, (0.0, 0.0, 0.0))
    ET.SubElement(inertial, "mass", value=numbers([inertia.mass]))
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    ET.SubElement(
        inertial, "inertia", {key: numbers([value]) for key, value in zip(names, inertia.tensor, strict=True)}
    )
    for capsule in capsules:
        _capsule(link, capsule)
    return link


def _capsule(link: ET.Element, capsule: Capsule) -> None:
    start, end = np.array(capsule.start), np.array(capsule.end)
    x, y, z = end - start
    length = math.hypot(x, y, z)
    along = (0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x))
    radius = numbers([capsule.radius])
    _collision(link, (start + end) / 2, along, "cylinder", length=numbers([length]), radius=radius)
    for centre in (start, end):
        _collision(link, centre, (0.0, 0.0, 0.0), "sphere", radius=radius)


def _collision(link: ET.Element, position, rpy, shape: str, **size: str) -> None:
    collision = ET.SubElement(link, "collision")
    _origin(collision, position, rpy)
    ET.SubElement(ET.SubElement(collision, "geometry"), shape, size)


def _joint(robot: ET.Element, name: str, kind: str, links: tuple[str, str], position, quat) -> ET.Element:
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    _origin(joint, position, _roll_pitch_yaw(quat))
    ET.SubElement(joint, "parent", link=links[0])
    ET.SubElement(joint, "child", link=links[1])
    return joint


def _limit(parent: ET.Element, joint: Joint) -> None:
    ends = {"lower": numbers([joint.q_min]), "upper": numbers([joint.q_max])} if math.isfinite(joint.q_min) else {}
    ET.SubElement(
        parent,
        "limit",
        ends,
        velocity=numbers([min(joint.qd_max, _FAST)]),
        effort=numbers([joint.tau_max]),
    )


def _origin(parent: ET.Element, position, rpy) -> None:
    ET.SubElement(parent, "origin", xyz=numbers(position), rpy=numbers(rpy))


def _roll_pitch_yaw(quat) -> tuple[float, float, float]:
    """Give URDF's angles, R = Rz(yaw) Ry(pitch) Rx(roll); at pitch ±90°, where only their sum counts, yaw is zero."""
    R = quat_to_matrix(np.array(quat))
    level = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], level)
    if level < 1e-9:
        return math.atan2(-R[1, 2], R[1, 1]), pitch, 0.0
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])
