"""Limits and losses of a user's joints: range, torque, rotor inertia, and the friction that the file declares."""

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import finite_array
from contactsafe.robot.binding import actuators_of
from contactsafe.robot.findings import Findings
from contactsafe.robot.friction import DRY_STEEP, FRICTION_FRACTION
from contactsafe.robot.names import JOINT, label, numbered, several

_CHANGE, _TICK_S = 0.1, 1e-3
"""Part of a joint's speed that compensation of friction may change in one tick."""

_POSTURES = 64

_SLOWEST_RAD_S = 0.1
"""A motor that viscous friction holds below this speed drives no arm."""

_USUAL_RATE, _USUAL_TORQUE = 1000.0, 87.0
"""Of a Panda, N m/s and N m: a motor of unknown torque rate reaches its limit in the same time."""

_SETTLES = (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)


def joint_range(model: mujoco.MjModel, chain: list[int]) -> np.ndarray:
    """Return the ends of the joints' ranges, (2, n), rad; ±inf without limits."""
    limited = model.jnt_limited[chain].astype(bool)
    return np.where(limited, model.jnt_range[chain].T, [[-np.inf], [np.inf]])


def torque_rate(given: float | None, tau_max: np.ndarray) -> float:
    """Return how fast motors change their torque, N m/s: as given, or in proportion to the strongest one."""
    if given is None:
        return _USUAL_RATE * max(1.0, float(tau_max.max()) / _USUAL_TORQUE)
    if not finite_array(given, (), "torque_rate_max") > 0.0:
        raise InvalidInputError(f"torque_rate_max = {given} must be greater than 0; give N m/s")
    return float(given)


def torque_limits(model: mujoco.MjModel, chain: list[int], given: ArrayLike | None, findings: Findings) -> np.ndarray:
    """Return the joints' torque limits, (n,), N m: the model's, or what is given where that is less.

    Args:
        model: of the scene.
        chain: the arm's joints.
        given: (n,), N m; None for the model's alone.
        findings: told of joints without a limit, whose limit is inf then.
    """
    limits = np.array([torque_limit(model, joint) for joint in chain])
    if given is not None:
        with findings.noting():
            limits = np.minimum(limits, finite_array(given, limits.shape, "tau_max"))
    unlimited = [joint for joint, limit in zip(chain, limits, strict=True) if not limit < np.inf]
    if unlimited:
        remedy = f"give tau_max=[...], {len(chain)} numbers in N m"
        findings.problem(f"{several(model, JOINT, unlimited)} no torque limit; {remedy}")
    for joint, limit in zip(chain, limits, strict=True):
        if not limit > 0.0:
            one = f"joint {label(model, JOINT, joint)} has a torque limit of {limit:g} N m, which is not above 0"
            findings.problem(f"{one}; give its motor a forcerange on both sides of 0, and no tau_max of 0")
    return np.where(limits > 0.0, limits, np.inf)


def torque_limit(model: mujoco.MjModel, joint: int) -> float:
    """Return what the model lets a joint's actuator do in both directions, N m; inf where it does not say.

    Of several the strongest counts. The control range of a servo is a position or a speed, and no torque.
    """
    works = [_of_actuator(model, actuator) for actuator in actuators_of(model, joint)]
    said = [limit for limit in works if limit < np.inf] or [np.inf]
    limit = max(said)
    return min(limit, _both_ways(model.jnt_actfrcrange[joint])) if model.jnt_actfrclimited[joint] else limit


def _of_actuator(model: mujoco.MjModel, actuator: int) -> float:
    ranges, gear = [np.inf], float(model.actuator_gear[actuator, 0])
    if model.actuator_forcelimited[actuator]:
        ranges.append(_both_ways(gear * model.actuator_forcerange[actuator]))
    settled = _settled_gain(model, actuator) * gear
    if model.actuator_ctrllimited[actuator] and settled != 0.0:
        ranges.append(_both_ways(settled * model.actuator_ctrlrange[actuator]))
    return min(ranges)


def _settled_gain(model: mujoco.MjModel, actuator: int) -> float:
    """Return the force of one unit of control, once a filter has settled; 0 for what is no motor."""
    direct = model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
    unbiased = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
    settles = mujoco.mjtDyn(model.actuator_dyntype[actuator]) in _SETTLES
    return float(model.actuator_gainprm[actuator, 0]) if direct and unbiased and settles else 0.0


def _both_ways(ends: np.ndarray) -> float:
    return float(max(0.0, min(-min(ends), max(ends))))


def rotor(model: mujoco.MjModel, joint: int) -> float:
    """Return the rotor inertia felt at a joint, kg m²: its own armature, and its actuators' through their gears."""
    return float(model.dof_armature[model.jnt_dofadr[joint]]) + _through_gears(model, joint, "actuator_armature")


def _through_gears(model: mujoco.MjModel, joint: int, name: str) -> float:
    """Return what actuators add to a joint; MuJoCo before 3.9 had nothing of the kind."""
    values = getattr(model, name, None)
    if values is None:
        return 0.0
    return float(sum(values[one] * model.actuator_gear[one, 0] ** 2 for one in actuators_of(model, joint)))


def declared_friction(
    model: mujoco.MjModel, chain: list[int], tau_max: np.ndarray, nominal: mujoco.MjModel, findings: Findings
) -> tuple[np.ndarray, np.ndarray]:
    """Return the friction that the file declares, as the model has it and as it is unknown.

    `FRICTION_FRACTION` of damping and frictionloss is in the model, less on joints so light that a sampled loop which
    compensates it would drive them: at most 1/10 of their speed may change in a tick, with the tick of 1 ms. Unknown is
    the rest of the damping, and all of the frictionloss: at rest it is anything from one end to the other.

    Args:
        model: of the scene.
        chain: the arm's joints.
        tau_max: (n,), N m.
        nominal: model of the arm alone.
        findings: told of joints whose motors cannot turn them.

    Returns:
        `Arm.drag`, (n, 3), and `Arm.friction_unknown`, (n, 2).
    """
    dofs = model.jnt_dofadr[chain]
    viscous = model.dof_damping[dofs] + [_through_gears(model, joint, "actuator_damping") for joint in chain]
    dry = model.dof_frictionloss[dofs]
    stuck = (dry >= tau_max) | (viscous * _SLOWEST_RAD_S > tau_max)
    if stuck.any():
        joints = several(model, JOINT, [joint for joint, is_stuck in zip(chain, stuck, strict=True) if is_stuck])
        findings.problem(
            f"{joints} frictionloss {numbered(dry[stuck])} N m and damping {numbered(viscous[stuck])} N m s/rad, which "
            f"torque limits of {numbered(tau_max[stuck])} N m do not move; lower them, servos hide such friction"
        )
    most = _CHANGE / _TICK_S * _least_inertia(nominal)
    damping = np.minimum(FRICTION_FRACTION * viscous, most)
    drag = np.column_stack([damping, 0.0 * viscous, np.minimum(FRICTION_FRACTION * dry, most / (0.5 * DRY_STEEP))])
    return drag, np.column_stack([viscous - damping, dry])


def _least_inertia(nominal: mujoco.MjModel) -> np.ndarray:
    """Return the least inertia that each joint moves, 1/(M⁻¹)ᵢᵢ, over random postures, (n,), kg m²."""
    data, rng, largest = mujoco.MjData(nominal), np.random.default_rng(0), np.zeros(nominal.nv)
    unit = np.eye(nominal.nv)
    for _ in range(_POSTURES):
        data.qpos[:] = rng.uniform(-np.pi, np.pi, nominal.nv)
        mujoco.mj_forward(nominal, data)
        M_inv = np.empty((nominal.nv, nominal.nv))
        mujoco.mj_solveM(nominal, data, M_inv, unit)
        largest = np.maximum(largest, np.diag(M_inv))
    return 1.0 / largest
