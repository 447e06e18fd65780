"""Where an arm's joints, motors and wrist sensors are in a MuJoCo model that holds other things too."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.findings import Findings
from contactsafe.robot.names import ACTUATOR, JOINT, find, label, listed, several
from contactsafe.robot.wrist import Wrist, WristNames, find_wrist


class Binding(NamedTuple):
    """Where to read an arm in a MuJoCo model, and where to drive it; joints from base to tip.

    Attributes:
        qpos: joint positions are `data.qpos[qpos]`, (n,).
        dof: joint velocities are `data.qvel[dof]`, and so on for all that is counted by degrees of freedom, (n,).
        ctrl: controls are `data.ctrl[ctrl]`, (n,).
        gear: joint torque of one unit of control, (n,), N m: `data.ctrl[ctrl] = torque / gear`.
        steps: calls of `mj_step` that make one tick.
        wrist: the sensors at the wrist, or why there are none.
    """

    qpos: np.ndarray
    dof: np.ndarray
    ctrl: np.ndarray
    gear: np.ndarray
    steps: int
    wrist: Wrist | str

    def wrench(self, data: mujoco.MjData) -> np.ndarray:
        """Return the environment's wrench on the tool as the sensors at the wrist say, for `Measurement`; see `Wrist`.

        Args:
            data: of the model that the arm was bound to, after a step or `mj_forward`.

        Raises:
            InvalidInputError: the model has no such sensors.
        """
        if isinstance(self.wrist, str):
            raise InvalidInputError(self.wrist)
        return self.wrist.wrench(data)


def bind_joints(
    names: Sequence[str], site: str, model: mujoco.MjModel, tick_s: float, wrist: WristNames | None
) -> Binding:
    """Find joints, their motors and the sensors at the wrist in a model; see `Arm.bind`."""
    findings, motors = Findings(), list[int | None]()
    joints = [find(model, JOINT, name) for name in names]
    for joint in joints:
        with findings.noting():
            motors.append(actuator_of(model, joint))
    bare = [joint for joint in joints if not actuators_of(model, joint)]
    if bare:
        remedy = f"""add <motor joint="{mujoco.mj_id2name(model, JOINT, bare[0])}"/> to <actuator>"""
        findings.problem(f"{several(model, JOINT, bare)} no motor; {remedy}")
    with findings.noting():
        _refuse_servos(model, [motor for motor in motors if motor is not None], site)
    steps = round(tick_s / model.opt.timestep)
    if steps < 1 or abs(steps * model.opt.timestep - tick_s) > 1e-9:
        findings.problem(
            f"the model's timestep of {model.opt.timestep:g} s does not divide the controller's tick of {tick_s:g} s; "
            f'set <option timestep="{tick_s:g}"/>'
        )
    findings.raise_problems()
    driven = [motor for motor in motors if motor is not None]
    return Binding(
        qpos=model.jnt_qposadr[joints].astype(int),
        dof=model.jnt_dofadr[joints].astype(int),
        ctrl=controls_of(model, driven),
        gear=np.array([torque_per_control(model, motor) for motor in driven]),
        steps=steps,
        wrist=_wrist(model, names[-1], site, wrist),
    )


def controls_of(model: mujoco.MjModel, motors: list[int]) -> np.ndarray:
    """Return where the controls of actuators of one control each are in `MjData.ctrl`, (n,)."""
    if hasattr(model, "actuator_ctrladr"):
        return model.actuator_ctrladr[motors].astype(int)
    return np.array(motors, dtype=int)  # before MuJoCo 3.11 every actuator had one


def _wrist(model: mujoco.MjModel, last_joint: str, site: str, names: WristNames | None) -> Wrist | str:
    """Find the sensors at the wrist; where none were named there may be none, and the reason is for who asks."""
    try:
        return find_wrist(model, last_joint, site, names or WristNames())
    except InvalidInputError as error:
        if names is not None:
            raise
        return str(error)


def actuators_of(model: mujoco.MjModel, joint: int) -> list[int]:
    """Find all actuators that work on a joint."""
    on_joints = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    works = np.isin(model.actuator_trntype, on_joints) & (model.actuator_trnid[:, 0] == joint)
    return [int(actuator) for actuator in np.flatnonzero(works)]


def actuator_of(model: mujoco.MjModel, joint: int) -> int | None:
    """Find the actuator that works on a joint; None where there is none.

    Raises:
        InvalidInputError: there are several.
    """
    found = actuators_of(model, joint)
    if len(found) > 1:
        names = listed(label(model, ACTUATOR, actuator) for actuator in found)
        raise InvalidInputError(
            f"joint {label(model, JOINT, joint)} has {len(found)} actuators ({names}); "
            "the controller gives one torque a joint: keep one"
        )
    return found[0] if found else None


def torque_per_control(model: mujoco.MjModel, actuator: int) -> float:
    """Return the joint torque of one unit of control, N m; 0 where the actuator is no motor, whose torque that is."""
    is_motor = (
        model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
        and model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
        and model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_NONE
    )
    return float(model.actuator_gainprm[actuator, 0] * model.actuator_gear[actuator, 0]) if is_motor else 0.0


def _refuse_servos(model: mujoco.MjModel, actuators: list[int], site: str) -> None:
    servos = [actuator for actuator in actuators if torque_per_control(model, actuator) == 0.0]
    if not servos:
        return
    joint = mujoco.mj_id2name(model, JOINT, model.actuator_trnid[servos[0], 0])
    one = f"actuator {label(model, ACTUATOR, servos[0])} of joint '{joint}' is no motor, which turns its"
    if len(servos) > 1:
        one = f"actuators {listed(label(model, ACTUATOR, servo) for servo in servos)} are no motors, which turn their"
    raise InvalidInputError(
        f'{one} control into torque and nothing else; replace it by <motor joint="{joint}"/>, or edit the scene\'s '
        f"MjSpec with robots.make_torque_driven(spec, '{site}')"
    )
