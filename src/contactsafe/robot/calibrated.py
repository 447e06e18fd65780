"""An arm with what was identified of it: friction, rotors, payload, sensors."""

import copy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import quat_to_matrix
from contactsafe.robot.arm import Arm, require_arm
from contactsafe.robot.calibration import Calibration
from contactsafe.robot.description import ArmDescription, Inertia, Tool
from contactsafe.robot.payload import Payload, set_inertia
from contactsafe.robot.regressor import inertia_in_body, link_inertia, site_in_link


def calibrated(arm: Arm, calibration: Calibration | str | Path) -> Arm:
    """Return the arm as it was identified.

    What the calibration does not say stays as it is, and so does the payload where another tool is carried than the
    one it was identified with.

    Args:
        arm: by its description.
        calibration: of this robot, or the path of its file.

    Raises:
        InvalidInputError: the file is no calibration, it is of another robot, what was identified is no arm, or the
            arm is calibrated already.
    """
    if require_arm(arm).calibrated:
        raise InvalidInputError(
            f"arm '{arm.name}' is calibrated already, and a payload would count twice; give the arm of its description"
        )
    known = calibration if isinstance(calibration, Calibration) else Calibration.load(calibration)
    if known.n != arm.n or known.robot != arm.name:
        raise InvalidInputError(
            f"the calibration is of '{known.robot}' with {known.n} joints, the arm is '{arm.name}' with {arm.n}; "
            "give that of this robot"
        )
    model, friction, drag, unknown = copy.deepcopy(arm.model), arm.friction, arm.drag, arm.friction_unknown
    if known.losses is not None:
        friction, drag = known.losses.friction, known.losses.drag
        still = np.where(np.isnan(known.stiction), unknown[:, 1], np.minimum(unknown[:, 1], known.stiction))
        unknown = np.column_stack([0.0 * still, still])  # at rest dry friction may still be anything
    if known.rotor is not None:
        model.dof_armature[:] = known.rotor
    load = known.payload if known.payload is not None and known.tool == tool_name(arm) else None
    if load is not None:
        _join(model, arm, load)
    sensor = known.sensor
    description, tool = _described(arm, model, friction, load)
    return replace(
        arm,
        model=model,
        friction=friction,
        drag=drag,
        friction_unknown=unknown,
        sensor_friction=arm.sensor_friction if sensor is None else sensor.friction,
        sensor_drag=arm.sensor_drag if sensor is None else sensor.drag,
        description=description,
        tool=tool,
        calibrated=True,
    )


def arm_for(given: Arm | Calibration | None, usual: Callable[[], Arm]) -> Arm:
    """Return the arm that was given; the usual one where none was, as calibrated where a calibration was.

    Raises:
        InvalidInputError: that is no arm, or the calibration of another robot.
    """
    if isinstance(given, Calibration):
        return calibrated(usual(), given)
    return usual() if given is None else require_arm(given)


def tool_name(arm: Arm) -> str:
    """Return the name of what the flange carries, empty where nobody says."""
    return "" if arm.tool is None else arm.tool.name


def is_body(inertia: Inertia) -> bool:
    """Tell whether a rigid body can have this inertia."""
    moments = np.linalg.eigvalsh(inertia.matrix())
    return inertia.mass > 0.0 and moments[0] >= 0.0 and bool(moments[2] <= moments[0] + moments[1] + 1e-12)


def can_carry(arm: Arm, load: Payload) -> bool:
    """Tell whether the last link with all it carries is still a body with a payload, whose mass may be negative."""
    return _carrier(arm, load) is not None


def _carrier(arm: Arm, load: Payload) -> tuple[int, Inertia] | None:
    """Return which body takes a payload, and its inertia then.

    That is what carries the tool point; where it would be no body, the last link with all that is fixed to it.
    """
    model, site = arm.model, arm.model.site(arm.site).id
    body, last = int(model.site_bodyid[site]), int(model.jnt_bodyid[arm.n - 1])
    joined = _joined(inertia_in_body(model, body), load, quat_to_matrix(model.site_quat[site]), model.site_pos[site])
    if joined is None:
        body, joined = last, _joined(link_inertia(arm, arm.n), load, *site_in_link(arm))
    return None if joined is None else (body, joined)


def _joined(own: Inertia, load: Payload, R: np.ndarray, origin: np.ndarray) -> Inertia | None:
    """Return a body with a payload whose frame has R and an origin in the body's; None where no body is so."""
    if own.mass + load.mass <= 0.0:
        return None
    joined = own + Inertia.of(load.mass, origin + R @ load.com, R @ load.inertia @ R.T)
    return joined if is_body(joined) else None


def _join(model: mujoco.MjModel, arm: Arm, load: Payload) -> None:
    found = _carrier(arm, load)
    if found is None:
        raise InvalidInputError(
            f"the calibration's payload of {load.mass:.3g} kg leaves the last link of '{arm.name}' no body; "
            "identify anew"
        )
    body, joined = found
    if body != model.site_bodyid[model.site(arm.site).id]:  # it has taken up the others
        others = np.flatnonzero(model.body_weldid == body)
        model.body_mass[others], model.body_inertia[others] = 0.0, 0.0
    set_inertia(model, body, joined)


def _described(
    arm: Arm, model: mujoco.MjModel, friction: np.ndarray, load: Payload | None
) -> tuple[ArmDescription | None, Tool | None]:
    """Return the description and the tool that simulated worlds build this arm from."""
    description, tool = arm.description, arm.tool
    if description is None or tool is None:
        return description, tool
    links = []
    for link, phi, rotor in zip(description.links, friction, model.dof_armature, strict=True):
        phi1, phi2, phi3 = (float(value) for value in phi)
        links.append(replace(link, joint=replace(link.joint, friction=(phi1, phi2, phi3), armature=float(rotor))))
    if load is not None:
        R, origin = quat_to_matrix(np.array(description.mount_quat)), np.array(description.mount_position)
        at = origin + R @ np.array(tool.tcp)
        joined = _joined(links[-1].inertia, load, R, at)
        if joined is None:
            carried = Payload(tool.inertia.mass, np.array(tool.inertia.com), tool.inertia.matrix())
            with_tool = _joined(links[-1].inertia, carried, R, origin)
            joined = None if with_tool is None else _joined(with_tool, load, R, at)
            tool = replace(tool, inertia=Inertia(0.0, (0.0, 0.0, 0.0), (0.0,) * 6))
        links[-1] = replace(links[-1], inertia=joined or links[-1].inertia)
    return replace(description, links=tuple(links)), tool
