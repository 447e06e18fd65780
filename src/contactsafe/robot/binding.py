"""Where an arm's joints and motors are in a MuJoCo model that holds other things too."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError

JOINT, SITE, ACTUATOR = mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtObj.mjOBJ_ACTUATOR
_LISTED = 12  # names that a message lists


class Binding(NamedTuple):
    """Where to read an arm in a MuJoCo model, and where to drive it; joints from base to tip.

    Attributes:
        qpos: joint positions are `data.qpos[qpos]`, (n,).
        dof: joint velocities are `data.qvel[dof]`, and so on for all that is counted by degrees of freedom, (n,).
        ctrl: controls are `data.ctrl[ctrl]`, (n,).
        gear: joint torque of one unit of control, (n,), N m: `data.ctrl[ctrl] = torque / gear`.
        steps: calls of `mj_step` that make one tick.
    """

    qpos: np.ndarray
    dof: np.ndarray
    ctrl: np.ndarray
    gear: np.ndarray
    steps: int


def bind_joints(names: Sequence[str], model: mujoco.MjModel, tick_s: float) -> Binding:
    """Find joints and their motors in a model; see `Arm.bind`."""
    joints = [find(model, JOINT, name) for name in names]
    motors = [_motor_of(model, joint) for joint in joints]
    steps = round(tick_s / model.opt.timestep)
    if steps < 1 or abs(steps * model.opt.timestep - tick_s) > 1e-9:
        raise InvalidInputError(
            f"the model's timestep of {model.opt.timestep:g} s does not divide the controller's tick of {tick_s:g} s; "
            f'set <option timestep="{tick_s:g}"/>'
        )
    return Binding(
        qpos=model.jnt_qposadr[joints].astype(int),
        dof=model.jnt_dofadr[joints].astype(int),
        ctrl=model.actuator_ctrladr[motors].astype(int),
        gear=np.array([torque_per_control(model, motor) for motor in motors]),
        steps=steps,
    )


def find(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> int:
    """Return the number of a named thing.

    Raises:
        InvalidInputError: there is none of that name.
    """
    found = mujoco.mj_name2id(model, kind, str(name))
    if found < 0:
        word = kind.name.removeprefix("mjOBJ_").lower()
        count = {JOINT: model.njnt, SITE: model.nsite, ACTUATOR: model.nactuator}[kind]
        names = [mujoco.mj_id2name(model, kind, i) for i in range(count)]
        raise InvalidInputError(f"{word} '{name}' is not in the model; give one of: {listed(filter(None, names))}")
    return found


def label(model: mujoco.MjModel, kind: mujoco.mjtObj, number: int) -> str:
    """Name a thing for a message: by its name, or by its number where it has none."""
    name = mujoco.mj_id2name(model, kind, number)
    return f"'{name}'" if name else f"{number} (without a name)"


def listed(names: Iterable[object]) -> str:
    """Write names for a message, the first dozen of them."""
    words = [str(name) for name in names]
    more = f" and {len(words) - _LISTED} more" if len(words) > _LISTED else ""
    return ", ".join(words[:_LISTED]) + more or "none"


def actuator_of(model: mujoco.MjModel, joint: int) -> int | None:
    """Find the actuator that works on a joint; None where there is none.

    Raises:
        InvalidInputError: there are several.
    """
    on_joints = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    works = np.isin(model.actuator_trntype, on_joints) & (model.actuator_trnid[:, 0] == joint)
    found = [int(actuator) for actuator in np.flatnonzero(works)]
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


def _motor_of(model: mujoco.MjModel, joint: int) -> int:
    name = mujoco.mj_id2name(model, JOINT, joint)
    actuator = actuator_of(model, joint)
    if actuator is None:
        raise InvalidInputError(f"""joint '{name}' has no motor; add <motor joint="{name}"/> to <actuator>""")
    if torque_per_control(model, actuator) == 0.0:
        raise InvalidInputError(
            f"actuator {label(model, ACTUATOR, actuator)} of joint '{name}' is no motor, which turns its control into "
            f"""torque and nothing else; replace it by <motor joint="{name}"/>"""
        )
    return actuator
