"""MJCF generated from an arm's description: the same arm for the nominal model, the plant and the pictures."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable

from contactsafe.robot.description import ArmDescription, Capsule, Inertia, Tool

TOOL_SITE = "tcp"
TIP_GEOM = "tip"
FLANGE_SITE = "flange"
ARM_CONTYPE = 2
"""Collision type of the arm's geoms: they meet what has conaffinity 2, and never each other."""


def numbers(values: Iterable[float]) -> str:
    """Write numbers for an XML attribute so that they read back to the same floats."""
    return " ".join(repr(float(value)) for value in values)


def _inertial(parent: ET.Element, inertia: Inertia) -> None:
    ET.SubElement(
        parent, "inertial", mass=numbers([inertia.mass]), pos=numbers(inertia.com), fullinertia=numbers(inertia.tensor)
    )


def _capsules(parent: ET.Element, prefix: str, capsules: tuple[Capsule, ...]) -> None:
    for index, capsule in enumerate(capsules):
        ET.SubElement(
            parent,
            "geom",
            {"class": "arm"},
            name=f"{prefix}_{index}",
            type="capsule",
            fromto=numbers((*capsule.start, *capsule.end)),
            size=numbers([capsule.radius]),
        )


def arm_default() -> ET.Element:
    """Give the default class for the arm's geoms: they meet the world, never each other."""
    default = ET.Element("default")
    inner = ET.SubElement(default, "default", {"class": "arm"})
    ET.SubElement(inner, "geom", contype=str(ARM_CONTYPE), conaffinity="1", rgba="0.93 0.93 0.95 1", group="2")
    return default


def arm_body(description: ArmDescription, tool: Tool) -> ET.Element:
    """Build the body tree of an arm with its tool, base frame at the world origin.

    Bodies are `link0` … `link<n>` and `tool`; joints `joint1` …; sites `flange` (in `tool`, at the mount) and `tcp`.
    """
    base = ET.Element("body", name="link0")
    _inertial(base, description.base)
    _capsules(base, "link0", description.base_capsules)
    parent = base
    for index, link in enumerate(description.links, start=1):
        parent = ET.SubElement(parent, "body", name=f"link{index}", pos=numbers(link.position), quat=numbers(link.quat))
        _inertial(parent, link.inertia)
        joint = ET.SubElement(
            parent, "joint", name=f"joint{index}", axis="0 0 1", armature=numbers([link.joint.armature])
        )
        if math.isfinite(link.joint.q_min):
            joint.set("range", numbers((link.joint.q_min, link.joint.q_max)))
        _capsules(parent, f"link{index}", link.capsules)
    mount = ET.SubElement(
        parent, "body", name="tool", pos=numbers(description.mount_position), quat=numbers(description.mount_quat)
    )
    if tool.inertia.mass > 0.0:
        _inertial(mount, tool.inertia)
    _capsules(mount, "tool", tool.capsules)
    if tool.tip is not None:
        centre = (tool.tcp[0], tool.tcp[1], tool.tcp[2] - tool.tip.half_size[2])
        ET.SubElement(
            mount,
            "geom",
            {"class": "arm"},
            name=TIP_GEOM,
            type=tool.tip.shape,
            pos=numbers(centre),
            size=numbers(tool.tip.half_size if tool.tip.shape == "box" else tool.tip.half_size[1:]),
            rgba="0.2 0.35 0.7 1",
        )
    ET.SubElement(mount, "site", name=FLANGE_SITE)
    ET.SubElement(mount, "site", name=TOOL_SITE, pos=numbers(tool.tcp))
    return base


def model_root(name: str) -> ET.Element:
    """Start an MJCF document with the options of every model: 1 kHz, dense Jacobians (mujoco 4.0.0 needs them)."""
    root = ET.Element("mujoco", model=name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    option = ET.SubElement(root, "option", timestep="0.001", jacobian="dense", cone="elliptic")
    # mujoco 4.0.0 at times finds a cylinder 10 mm deep in a box that it touches, where it looks for several contacts.
    ET.SubElement(option, "flag", multiccd="disable")
    root.append(arm_default())
    return root


def arm_mjcf(description: ArmDescription, tool: Tool) -> str:
    """Write the arm alone, fixed at the origin, with motors of the stated torque limits."""
    root = model_root(description.name)
    world = ET.SubElement(root, "worldbody")
    world.append(arm_body(description, tool))
    actuator = ET.SubElement(root, "actuator")
    for index, link in enumerate(description.links, start=1):
        limit = link.joint.tau_max
        ET.SubElement(
            actuator, "motor", name=f"motor{index}", joint=f"joint{index}", ctrlrange=numbers((-limit, limit))
        )
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")
