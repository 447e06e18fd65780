"""A downloaded model made fit for the controller: motors in place of servos, a site at the flange, the timestep."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.binding import actuators_of
from contactsafe.robot.bodies import link_of
from contactsafe.robot.findings import Findings
from contactsafe.robot.missing_meshes import find_meshes
from contactsafe.robot.names import BODY, JOINT, SITE, find, or_flange
from contactsafe.robot.spec_parts import Flange, add_flange, become_motor, compiled_spec, name_all, remove
from contactsafe.robot.user_chain import choose_chain, is_led, refuse_tied
from contactsafe.robot.user_limits import torque_limits


def make_torque_driven(
    spec: mujoco.MjSpec,
    site: str | Flange,
    joints: Sequence[str] | None = None,
    *,
    tau_max: ArrayLike | None = None,
    timestep: float = 0.001,
) -> str:
    """Edit a scene in place so that the controller can drive an arm in it; compile it afterwards.

    Each of the arm's joints gets one motor in place of its position or velocity servos, with their force limit; gear,
    rotor inertia and friction stay. The arm carries its own weight no more (gravcomp), follows no mocap body, and what
    key frames say of its controls is 0. The timestep becomes the tick's, unless it divides it. Joints without a name
    get one. For two arms in one scene call it for each.

    Args:
        spec: of the scene.
        site: end-effector point by its name, or a `Flange` to make one.
        joints: names of the arm's hinges from base to tip; None for all that move the site.
        tau_max: torque limits, (n,), N m; None for the model's own. The smaller holds.
        timestep: of the model, s.

    Returns:
        The site's name.

    Raises:
        InvalidInputError: a name is unknown, a joint is no hinge, has no torque limit, or an equality constraint ties
            the arm.
    """
    if not isinstance(spec, mujoco.MjSpec):
        raise InvalidInputError(f"spec is {type(spec).__name__}; give the mujoco.MjSpec of the scene")
    findings = Findings()
    name, model, chain, limits = _examine(spec, site, joints, tau_max, findings)
    findings.raise_problems()
    _edit(spec, model, chain, limits, timestep)
    refuse_tied(compiled_spec(spec, "the edited MjSpec"), chain, findings)
    findings.raise_problems()
    findings.warn(spec.modelname)
    return name


def torque_driven_copy(
    spec: mujoco.MjSpec,
    site: str | Flange | None,
    joints: Sequence[str] | None,
    tau_max: ArrayLike | None,
    findings: Findings,
) -> tuple[mujoco.MjSpec, str]:
    """Return a scene as `make_torque_driven` edits it, as far as its problems let it, and the site's name.

    Args:
        spec: of the scene; stays as it is.
        site, joints, tau_max: as of `make_torque_driven`.
        findings: told of problems and notes.
    """
    spec = spec.copy()
    name, model, chain, limits = _examine(spec, site, joints, tau_max, findings)
    _edit(spec, model, chain, limits, model.opt.timestep)
    return spec, name


def _examine(
    spec: mujoco.MjSpec,
    site: str | Flange | None,
    joints: Sequence[str] | None,
    tau_max: ArrayLike | None,
    findings: Findings,
) -> tuple[str, mujoco.MjModel, list[int], np.ndarray]:
    """Return site, compiled scene, joints and torque limits; parts get names, and missing meshes are taken off."""
    name_all(spec)
    find_meshes(spec, findings)
    findings.raise_problems()
    name = add_flange(spec, site)
    model = compiled_spec(spec, "the MjSpec")
    site_id = find(model, SITE, name, or_flange(model))
    chain = choose_chain(model, site_id, joints, findings, many=True)
    return model.site(site_id).name, model, chain, torque_limits(model, chain, tau_max, findings)


def _edit(spec: mujoco.MjSpec, model: mujoco.MjModel, chain: list[int], limits: np.ndarray, timestep: float) -> None:
    _follow_nothing(spec, model, chain)
    keys = _controls_of_keys(spec, model, chain)
    for joint, limit in zip(chain, limits, strict=True):
        _give_motor(spec, model, joint, float(limit))
    for key, ctrl, act in keys:
        key.ctrl, key.act = ctrl, act
    for body in np.flatnonzero(link_of(model, chain)):
        spec.body(mujoco.mj_id2name(model, BODY, body)).gravcomp = 0.0
    steps = round(timestep / model.opt.timestep)
    if steps < 1 or abs(steps * model.opt.timestep - timestep) > 1e-9:
        spec.option.timestep = timestep


def _give_motor(spec: mujoco.MjSpec, model: mujoco.MjModel, joint: int, limit: float) -> None:
    """Let one motor turn a joint, N m, in place of all that did."""
    name, works = mujoco.mj_id2name(model, JOINT, joint), actuators_of(model, joint)
    for extra in works[1:]:
        remove(spec, spec.actuator(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, extra)))
    if works:
        motor = spec.actuator(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, works[0]))
        gear = abs(float(model.actuator_gear[works[0], 0])) or 1.0
    else:
        motor, gear = spec.add_actuator(name=f"{name}_motor", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT), 1.0
    become_motor(motor, limit / gear)


def _follow_nothing(spec: mujoco.MjSpec, model: mujoco.MjModel, chain: list[int]) -> None:
    """Remove what leads the arm after a mocap body."""
    links = link_of(model, chain)
    led = [i for i in range(model.neq) if is_led(model, i) and _leads(model, i, links)]
    for name in [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_EQUALITY, i) for i in led]:
        remove(spec, spec.equality(name))


def _leads(model: mujoco.MjModel, i: int, links: np.ndarray) -> bool:
    ends = (model.eq_obj1id[i], model.eq_obj2id[i])
    bodies = [model.site_bodyid[end] for end in ends] if model.eq_objtype[i] == int(SITE) else ends
    return any(links[body] > 0 for body in bodies)


def _controls_of_keys(spec: mujoco.MjSpec, model: mujoco.MjModel, chain: list[int]) -> list[tuple[Any, list, list]]:
    """Return each key frame with its controls and activations once the arm has motors."""
    works = [actuators_of(model, joint) for joint in chain]
    gone = {actuator for several in works for actuator in several[1:]}
    arm = {actuator for several in works for actuator in several}
    stay = [one for one in range(model.actuator_trntype.size) if one not in gone]
    added = sum(not several for several in works) * [0.0]
    first, count = model.actuator_actadr, model.actuator_actnum
    controls = np.append(getattr(model, "actuator_ctrladr", np.arange(model.nu)), model.nu)
    found = []
    for key, ctrl, act in zip(spec.keys, model.key_ctrl, model.key_act, strict=True):
        kept = [[0.0] if one in arm else ctrl[controls[one] : controls[one + 1]] for one in stay]
        active = [act[first[one] : first[one] + count[one]] for one in stay if one not in arm and count[one]]
        found.append((key, [*np.concatenate([[], *kept]), *added], list(np.concatenate([[], *active]))))
    return found
