"""A URDF made fit for MuJoCo: without pictures, its meshes found on this disk or left out, its joints with motors."""

import os
import pathlib
import xml.etree.ElementTree as ET

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.robot.findings import Findings
from contactsafe.robot.names import listed
from contactsafe.robot.spec_parts import become_motor

_READ = (".stl", ".obj", ".msh")
"""Kinds of meshes that MuJoCo reads."""

_MOTOR = "{}_motor"
_PLACES = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
"""Environment variables that say where packages are."""


def urdf_spec(path: str | os.PathLike, link: str) -> tuple[mujoco.MjSpec, str]:
    """Read a URDF as a MuJoCo scene that the controller can drive: to be added to, and then compiled.

    Revolute and continuous joints have motors with the file's `effort`; neighbouring links do not collide, the timestep
    is 1 ms. Meshes of `package://` are looked for beside and above the file and where ROS says; one `ModelWarning`
    names those that are not there or that MuJoCo cannot read.

    Args:
        path: of the URDF.
        link: whose frame is the end-effector point.

    Returns:
        The scene, and the name of the site that is made at the link.

    Raises:
        InvalidInputError: the file cannot be read or has no such link.
    """
    findings = Findings()
    spec, site = read_urdf(path, link, findings)
    findings.warn(spec.modelname)
    return spec, site


def read_urdf(path: str | os.PathLike, link: str | None, findings: Findings) -> tuple[mujoco.MjSpec, str]:
    """Read a URDF as `urdf_spec` does, and tell `findings` of missing meshes."""
    root = robot_of(path)
    names = [one.get("name", "") for one in root.findall("link")]
    if link not in names:
        what = "link = None" if link is None else f"{os.fspath(path)} has no link {shown(link)}"
        raise InvalidInputError(f"{what}; give one of {listed(names)}")
    site = link if link not in {joint.get("name") for joint in root.findall("joint")} else f"{link}_frame"
    _keep_what_collides(root, pathlib.Path(path), findings)
    try:
        spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InvalidInputError(f"MuJoCo cannot read '{os.fspath(path)}': {reason}; mend the file") from None
    (spec.body(link) or spec.worldbody).add_site(name=site)  # the root link is the world
    spec.option.timestep = 0.001
    _give_motors(spec, root)
    return spec, site


def robot_of(path: str | os.PathLike) -> ET.Element:
    """Read a URDF: joints and links are its children, <transmission> and <ros2_control> have others.

    Raises:
        InvalidInputError: it is none.
    """
    try:
        root = ET.parse(path).getroot()
    except (OSError, ET.ParseError) as error:
        raise InvalidInputError(f"{os.fspath(path)} is no URDF that can be read: {error}; give its path") from None
    if root.tag != "robot":
        raise InvalidInputError(f"{os.fspath(path)} has no <robot>; give a URDF")
    return root


def limit_of(joint: ET.Element, name: str) -> float:
    """Return a number of a joint's `<limit>`; inf where it has none."""
    limit = joint.find("limit")
    try:
        return float("inf" if limit is None else limit.get(name, "inf"))
    except ValueError:
        return np.inf


def _keep_what_collides(root: ET.Element, path: pathlib.Path, findings: Findings) -> None:
    """Take off what is only seen and meshes that cannot be had; name the others as they lie on this disk."""
    missing: list[str] = []
    for link in root.findall("link"):
        for part in link.findall("visual"):
            link.remove(part)
        for part, mesh in [(part, part.find("geometry/mesh")) for part in link.findall("collision")]:
            found = None if mesh is None else _mesh(mesh.get("filename", ""), path)
            if mesh is not None and found is None:
                missing.append(mesh.get("filename", ""))
                link.remove(part)
            elif mesh is not None:
                mesh.set("filename", str(found))
    if missing:
        findings.note(
            f"{len(missing)} collision meshes are left out: {listed(dict.fromkeys(missing))}; MuJoCo reads "
            f"{', '.join(_READ)}, and packages are looked for above the file and in ROS_PACKAGE_PATH; links without "
            "geometry are not told apart as well in a contact"
        )
    for extension in root.findall("mujoco"):
        root.remove(extension)
    compiler = ET.SubElement(ET.SubElement(root, "mujoco"), "compiler")
    compiler.attrib.update(fusestatic="false", balanceinertia="true", boundmass="1e-9", boundinertia="1e-12")
    compiler.attrib.update(strippath="false", discardvisual="false")


def _mesh(name: str, urdf: pathlib.Path) -> pathlib.Path | None:
    """Return where a mesh lies that MuJoCo can read: the file itself, or one beside it of the same name."""
    for place in _places(name, urdf):
        for candidate in (place, *(place.with_suffix(ending) for ending in _READ)):
            if candidate.suffix.lower() in _READ and candidate.is_file():
                return candidate.resolve()
    return None


def _places(name: str, urdf: pathlib.Path) -> list[pathlib.Path]:
    """Return where a file may be that a URDF names."""
    scheme, _, rest = name.rpartition("://")
    folders = list(urdf.resolve().parents)
    if scheme not in ("package", "model"):
        return [urdf.resolve().parent / rest]
    package, _, inside = rest.partition("/")
    said = [pathlib.Path(one) for key in _PLACES for one in os.environ.get(key, "").split(os.pathsep) if one]
    here = [folder / inside for folder in folders if folder.name == package]
    below = [found for folder in said for found in sorted(folder.glob(f"*/{rest}"))]  # as ROS 2 installs them
    return [*here, *(folder / rest for folder in (*folders, *said)), *below]


def _give_motors(spec: mujoco.MjSpec, root: ET.Element) -> None:
    """Give joints that turn their motors, and keep neighbours from colliding, as a URDF's reader does."""
    for joint in root.findall("joint"):
        effort, name = limit_of(joint, "effort"), joint.get("name", "")
        if joint.get("type") in ("revolute", "continuous") and spec.joint(name) is not None:
            motor = spec.add_actuator(name=_MOTOR.format(name), target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            become_motor(motor, effort if effort > 0.0 else np.inf)
    for body in spec.bodies[1:]:
        if body.parent is not None and body.parent.name != "world":
            spec.add_exclude(bodyname1=body.parent.name, bodyname2=body.name)
