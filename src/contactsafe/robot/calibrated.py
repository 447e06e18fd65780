"""An arm with what was identified of it: friction, rotors, payload, sensors."""

import copy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import matrix_to_quat, quat_to_matrix
from contactsafe.robot.arm import Arm, require_arm
from contactsafe.robot.calibration import Calibration
from contactsafe.robot.description import ArmDescription, Inertia, Joint
from contactsafe.robot.payload import Payload
from contactsafe.robot.regressor import inertia_in_body


def calibrated(arm: Arm, calibration: Calibration | str | Path) -> Arm:
    """Return the arm as it was identified.

    What the calibration does not say stays as it is, and so does the payload where another tool is carried than the
    one it was identified with.

    Args:
        arm: by its description.
        calibration: of this robot, or the path of its file.

    Raises:
        InvalidInputError: the file is no calibration, it is of another robot, or what was identified is no arm.
    """
    require_arm(arm)
    known = calibration if isinstance(calibration, Calibration) else Calibration.load(calibration)
    if known.n != arm.n or known.robot != arm.name:
        raise InvalidInputError(
            f"the calibration is of '{known.robot}' with {known.n} joints, the arm is '{arm.name}' with {arm.n}; "
            "give that of this robot"
        )
    model, friction, drag = copy.deepcopy(arm.model), arm.friction, arm.drag
    if known.losses is not None:
        friction, drag = known.losses.friction, known.losses.drag
    if known.rotor is not None:
        model.dof_armature[:] = known.rotor
    load = known.payload if known.payload is not None and known.tool == tool_name(arm) else None
    if load is not None:
        _join(model, arm, load)
    sensor = known.sensor
    return replace(
        arm,
        model=model,
        friction=friction,
        drag=drag,
        sensor_friction=arm.sensor_friction if sensor is None else sensor.friction,
        sensor_drag=arm.sensor_drag if sensor is None else sensor.drag,
        description=_described(arm, model, friction, load),
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


def last_link_with(arm: Arm, load: Payload) -> Inertia | None:
    """Return the inertia that a body of the last link has with a payload, None where no body can have it."""
    found = _carrier(arm.model, arm, load)
    return None if found is None else found[1]


def _carrier(model: mujoco.MjModel, arm: Arm, load: Payload) -> tuple[int, Inertia] | None:
    """Return which body takes a payload, and its inertia then: what carries the tool point, or the link itself."""
    site = model.site(arm.site).id
    R, origin, body = quat_to_matrix(model.site_quat[site]), model.site_pos[site].copy(), int(model.site_bodyid[site])
    while True:
        own = inertia_in_body(model, body)
        if own.mass + load.mass > 0.0:
            joined = own + Inertia.of(load.mass, origin + R @ load.com, R @ load.inertia @ R.T)
            if is_body(joined):
                return body, joined
        if model.body_jntnum[body] > 0:
            return None
        turn = quat_to_matrix(model.body_quat[body])
        R, origin, body = turn @ R, model.body_pos[body] + turn @ origin, int(model.body_parentid[body])


def _join(model: mujoco.MjModel, arm: Arm, load: Payload) -> None:
    found = _carrier(model, arm, load)
    if found is None:
        raise InvalidInputError(
            f"the calibration's payload of {load.mass:.3g} kg leaves the last link of '{arm.name}' no body; "
            "identify anew"
        )
    body, joined = found
    moments, axes = np.linalg.eigh(joined.matrix())
    axes[:, 2] *= np.linalg.det(axes)  # a rotation, not a mirror
    model.body_mass[body], model.body_ipos[body] = joined.mass, joined.com
    model.body_inertia[body], model.body_iquat[body] = np.maximum(moments, 0.0), matrix_to_quat(axes)
    model.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _described(arm: Arm, model: mujoco.MjModel, friction: np.ndarray, load: Payload | None) -> ArmDescription | None:
    """Return the description that simulated worlds build this arm from."""
    description = arm.description
    if description is None:
        return None
    links = []
    for link, phi, rotor in zip(description.links, friction, model.dof_armature, strict=True):
        old = link.joint
        phi1, phi2, phi3 = (float(value) for value in phi)
        joint = Joint(old.q_min, old.q_max, old.qd_max, old.tau_max, (phi1, phi2, phi3), float(rotor))
        links.append(replace(link, joint=joint))
    if load is not None:
        links[-1] = replace(links[-1], inertia=links[-1].inertia + _at_last_link(arm, description, load))
    return replace(description, links=tuple(links))


def _at_last_link(arm: Arm, description: ArmDescription, load: Payload) -> Inertia:
    R = quat_to_matrix(np.array(description.mount_quat))
    tcp = np.zeros(3) if arm.tool is None else np.array(arm.tool.tcp)
    com = np.array(description.mount_position) + R @ (tcp + load.com)
    return Inertia.of(load.mass, com, R @ load.inertia @ R.T)
