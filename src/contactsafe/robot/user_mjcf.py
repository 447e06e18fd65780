"""The arm inside a user's own MJCF: a nominal model of it alone, whatever else stands in the scene.

The user's model is compiled by MuJoCo first, so that defaults, includes, meshes and inertias from geoms are resolved.
From it a canonical chain is built, as the compiled dynamics want it: one body a joint, and each body holds all that
is fixed to it. Its frames lie at the joints and are parallel to the world's while every joint is where the file puts
it; dynamics and the tool's pose do not depend on that choice.
"""

import os
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import matrix_to_quat
from contactsafe.robot.arm import Arm, finite_array, finite_range
from contactsafe.robot.binding import actuator_of, torque_per_control
from contactsafe.robot.bodies import inertia_of, link_of, shown_by
from contactsafe.robot.derived import NOTHING, Found, carried_tool, describe
from contactsafe.robot.description import Inertia, Joint, Tip
from contactsafe.robot.names import JOINT, SITE, find, label, listed
from contactsafe.robot.surface import geom_surface

_BODY, _KEY, _HINGE = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_KEY, mujoco.mjtJoint.mjJNT_HINGE
_LEVER_DOUBTED = 0.02
"""Of `Arm.lever_doubted`, m. Many arms are bent in one plane, where a push from the side fits points everywhere."""

_USUAL_RATE, _USUAL_TORQUE = 1000.0, 87.0
"""Of a Panda, N m/s and N m: a motor of unknown torque rate reaches its limit in the same time."""


def from_mjcf(
    scene: str | os.PathLike | mujoco.MjModel,
    site: str,
    joints: Sequence[str] | None = None,
    *,
    tau_max: ArrayLike | None = None,
    torque_rate_max: float | None = None,
    friction: ArrayLike | None = None,
    home: ArrayLike | None = None,
    tip: Tip | None = None,
) -> Arm:
    """Return the arm inside a user's own MJCF scene.

    The scene may hold anything else: tables, objects, a gripper, other robots. What is fixed to a link counts as part
    of it, and joints that are not the arm's are locked where the key frame 'home' has them, or where the model starts.
    Base pose, gravity and rotor inertia are the model's. Its surface is that of the colliding geoms of links 2 … n, or
    all geoms of a link where none collides, without what the last link carries. Damping, dry friction and springs of
    joints are left out: the controller feels them as external torque, so give `friction`, or keep them below its
    threshold.

    Args:
        scene: path of the MJCF file, or the model compiled from it.
        site: end-effector point; its axes are the tool's.
        joints: names of the arm's hinges from base to tip; None for all that move the site, if each has an actuator.
        tau_max: torque limits, (n,), N m; None for the model's own: forcerange and, of motors, ctrlrange, times gear,
            and actuatorfrcrange of joints. Where both are given, the smaller holds.
        torque_rate_max: N m/s; None for the strongest motor's limit in 87 ms, as on a Panda, and at least 1000.
        friction: φ1 N m, φ2 s/rad, φ3 rad/s of every joint (`contactsafe.robot.friction`), (n, 3); None for none.
        home: a posture well inside the limits, (n,), rad; None for the key frame 'home', or the middle of the range.
        tip: the part of the tool that works, its face centred on the site; None where no part is meant to. It counts in
            simulated worlds alone.

    Returns:
        An arm with the description and the tool that simulated worlds build it from. Limits that the model does not
        give are inf, as those of speed.

    Raises:
        InvalidInputError: the file cannot be read, a name is unknown, a joint is no hinge or does not move the
            site, the choice of joints or actuators is ambiguous, torque limits are missing, a body of the arm
            carries its own weight (gravcomp), an equality constraint ties the arm, or gravity or a range is no number.
    """
    model = _loaded(scene)
    site_id = find(model, SITE, site)
    chain = _chain(model, site_id, joints)
    n = len(chain)
    _refuse_weightless(model, chain)
    _refuse_tied(model, chain)
    q_min, q_max = _joint_range(model, chain)
    limits = _torque_limits(model, chain, tau_max)
    data, key_home = _at_start(model, chain)
    friction = np.zeros((n, 3)) if friction is None else finite_array(friction, (n, 3), "friction")
    home = _home(key_home if home is None else home, q_min, q_max)
    nominal, found = _nominal_model(model, data, chain, site_id, limits), Found(model, data, chain, site_id)
    name, rate = model.names.split(b"\0")[0].decode(), _torque_rate(torque_rate_max, limits)
    description = describe(found, name, _joints(nominal, q_min, q_max, limits, friction), rate, home)
    surface = geom_surface(model, data, shown_by(model, chain), data.xanchor[chain])
    return Arm(
        name, nominal, site, q_min, q_max, np.full(n, np.inf), limits, rate, friction, home, description,
        carried_tool(found, tip), surface, _LEVER_DOUBTED,
    )  # fmt: skip


def _joint_range(model: mujoco.MjModel, chain: list[int]) -> np.ndarray:
    limited = model.jnt_limited[chain].astype(bool)
    return np.where(limited, model.jnt_range[chain].T, [[-np.inf], [np.inf]])


def _torque_rate(given: float | None, tau_max: np.ndarray) -> float:
    """Return how fast motors change their torque, N m/s: as given, or in proportion to the strongest one."""
    if given is None:
        return _USUAL_RATE * max(1.0, float(tau_max.max()) / _USUAL_TORQUE)
    if not finite_array(given, (), "torque_rate_max") > 0.0:
        raise InvalidInputError(f"torque_rate_max = {given} must be greater than 0; give N m/s")
    return float(given)


def _joints(
    nominal: mujoco.MjModel, q_min: np.ndarray, q_max: np.ndarray, tau_max: np.ndarray, friction: np.ndarray
) -> tuple[Joint, ...]:
    """Return what the description says of each joint; the arguments have one row a joint."""
    rows = zip(q_min, q_max, tau_max, friction, nominal.dof_armature, strict=True)
    return tuple(
        Joint(float(low), float(high), np.inf, float(most), tuple(phi.tolist()), float(rotor))
        for low, high, most, phi, rotor in rows
    )


def _refuse_tied(model: mujoco.MjModel, chain: list[int]) -> None:
    """Refuse equality constraints on the arm: a dynamic model of the chain alone would not know them."""
    carried = {int(model.jnt_bodyid[joint]) for joint in chain}
    for i in np.flatnonzero(model.eq_active0).tolist():
        if not carried.isdisjoint(_tied_bodies(model, i)):
            name = label(model, mujoco.mjtObj.mjOBJ_EQUALITY, i)
            raise InvalidInputError(
                f"equality constraint {name} ties the arm; an arm is a free chain of hinges, remove it"
            )


def _tied_bodies(model: mujoco.MjModel, i: int) -> list[int]:
    """Return the moving bodies that an equality constraint ties: by their joints, by themselves or by their sites."""
    ends = [int(end) for end in (model.eq_obj1id[i], model.eq_obj2id[i]) if end >= 0]
    if model.eq_type[i] == int(mujoco.mjtEq.mjEQ_JOINT):
        return [int(model.jnt_bodyid[end]) for end in ends]
    if model.eq_objtype[i] == int(SITE):
        ends = [int(model.site_bodyid[end]) for end in ends]
    elif model.eq_objtype[i] != int(_BODY):
        return []
    return [int(model.body_weldid[end]) for end in ends]


def _loaded(scene) -> mujoco.MjModel:
    if isinstance(scene, mujoco.MjModel):
        return scene
    if not isinstance(scene, (str, os.PathLike)) or not os.path.isfile(scene):
        raise InvalidInputError(
            f"no file at '{str(scene)[:80]}'; give the path of an MJCF file, or a compiled mujoco.MjModel"
        )
    try:
        return mujoco.MjModel.from_xml_path(os.fspath(scene))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InvalidInputError(f"MuJoCo cannot read '{scene}': {reason}; mend the file") from None


def _chain(model: mujoco.MjModel, site_id: int, names: Sequence[str] | None) -> list[int]:
    """Choose the arm's joints among those that move the site, from base to tip."""
    moving = _joints_above(model, model.site_bodyid[site_id])
    site, rest = label(model, SITE, site_id), listed(label(model, JOINT, joint) for joint in moving)
    chosen = moving if names is None else [find(model, JOINT, name) for name in names]
    if not moving or not chosen:
        raise InvalidInputError(f"no joints for site {site}; give it to a body of the arm; joints that move it: {rest}")
    for joint in chosen:
        kind = mujoco.mjtJoint(model.jnt_type[joint])
        if joint not in moving:
            problem = f"does not move site {site}; joints that do, base to tip: {rest}"
        elif kind != _HINGE:
            word = kind.name.removeprefix("mjJNT_").lower()
            problem = f"is of type {word}; the arm's are hinges: give joints=[...] without it, to lock it"
        elif names is None and actuator_of(model, joint) is None:
            problem = "has no actuator; give joints=[...] with it, or without it, to lock it"
        else:
            continue
        raise InvalidInputError(f"joint {label(model, JOINT, joint)} {problem}")
    if chosen != [joint for joint in moving if joint in chosen]:
        raise InvalidInputError(
            f"joints = {list(names or ())} are not in order; from base to tip they stand so: {rest}"
        )
    return chosen


def _joints_above(model: mujoco.MjModel, body: int) -> list[int]:
    """Find all joints between the world and a body, from the world on."""
    joints: list[int] = []
    while body != 0:
        first = model.body_jntadr[body]
        joints[:0] = range(first, first + model.body_jntnum[body])
        body = model.body_parentid[body]
    return joints


def _refuse_weightless(model: mujoco.MjModel, chain: list[int]) -> None:
    floating = np.flatnonzero((link_of(model, chain) > 0) & (model.body_gravcomp != 0.0))
    if floating.size:
        raise InvalidInputError(
            f"body {label(model, _BODY, floating[0])} has gravcomp = {model.body_gravcomp[floating[0]]:g}; "
            "the controller's torque includes gravity, so it must be 0 on every body of the arm"
        )


def _torque_limits(model: mujoco.MjModel, chain: list[int], given) -> np.ndarray:
    limits = np.array([_torque_limit(model, joint) for joint in chain])
    if given is not None:
        limits = np.minimum(limits, finite_array(given, limits.shape, "tau_max"))
    for joint, limit in zip(chain, limits, strict=True):
        if not 0.0 < limit < np.inf:
            found = "no torque limit" if limit > 0.0 else f"a torque limit of {limit:g} N m, which is not above 0"
            raise InvalidInputError(
                f"joint {label(model, JOINT, joint)} has {found}; give tau_max=[...], {len(chain)} numbers in N m, "
                "and its motor a forcerange on both sides of 0"
            )
    return limits


def _torque_limit(model: mujoco.MjModel, joint: int) -> float:
    """Return what the model lets the joint's actuator do in both directions, N m; inf where it does not say."""
    ranges = []
    if model.jnt_actfrclimited[joint]:
        ranges.append(model.jnt_actfrcrange[joint])
    actuator = actuator_of(model, joint)
    if actuator is not None and model.actuator_forcelimited[actuator]:
        ranges.append(model.actuator_gear[actuator, 0] * model.actuator_forcerange[actuator])
    if actuator is not None and model.actuator_ctrllimited[actuator] and torque_per_control(model, actuator) != 0.0:
        ranges.append(torque_per_control(model, actuator) * model.actuator_ctrlrange[actuator])
    return min((max(0.0, min(-min(ends), max(ends))) for ends in ranges), default=np.inf)


def _at_start(model: mujoco.MjModel, chain: list[int]) -> tuple[mujoco.MjData, np.ndarray | None]:
    """Place all bodies with the arm's joints unturned and the others locked; give the arm's key frame 'home' too."""
    data = mujoco.MjData(model)
    address = model.jnt_qposadr[chain]
    key = mujoco.mj_name2id(model, _KEY, "home")
    if key >= 0:
        mujoco.mj_resetDataKeyframe(model, data, key)
    home = data.qpos[address].copy() if key >= 0 else None
    data.qpos[address] = model.qpos0[address]
    mujoco.mj_kinematics(model, data)
    return data, home


def _home(home, q_min: np.ndarray, q_max: np.ndarray) -> np.ndarray:
    if home is None:
        return np.mean(finite_range(q_min, q_max), axis=0)
    home = finite_array(home, q_min.shape, "home")
    outside = (home < q_min) | (home > q_max)
    if outside.any():
        i = int(np.argmax(outside))
        raise InvalidInputError(f"home[{i}] = {home[i]:g} rad is outside [{q_min[i]:g}, {q_max[i]:g}]; move it inside")
    return home


def _nominal_model(
    model: mujoco.MjModel, data: mujoco.MjData, chain: list[int], site_id: int, limits: np.ndarray
) -> mujoco.MjModel:
    """Build the arm alone: bodies `link1` … `link<n>`, joints and site of the user's names, a motor a joint."""
    spec = mujoco.MjSpec()
    spec.modelname = model.names.split(b"\0")[0].decode()
    spec.compiler.degree = False
    spec.option.timestep = 0.001
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    weightless = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    spec.option.gravity = np.zeros(3) if weightless else model.opt.gravity
    body, origin, links = spec.worldbody, np.zeros(3), link_of(model, chain)
    for link, (joint, limit) in enumerate(zip(chain, limits, strict=True), start=1):
        name = mujoco.mj_id2name(model, JOINT, joint)
        body = body.add_body(name=f"link{link}", pos=data.xanchor[joint] - origin)
        origin = data.xanchor[joint]
        _set_inertia(body, inertia_of(model, data, links == link, origin))
        body.add_joint(
            name=name,
            type=_HINGE,
            axis=data.xaxis[joint],
            ref=model.qpos0[model.jnt_qposadr[joint]],
            limited=bool(model.jnt_limited[joint]),
            range=model.jnt_range[joint],
            armature=_rotor(model, joint),
        )
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        motor.ctrllimited, motor.ctrlrange = True, (-limit, limit)
    quat = matrix_to_quat(data.site_xmat[site_id].reshape(3, 3))
    body.add_site(name=mujoco.mj_id2name(model, SITE, site_id), pos=data.site_xpos[site_id] - origin, quat=quat)
    return spec.compile()


def _rotor(model: mujoco.MjModel, joint: int) -> float:
    """Return the rotor inertia felt at a joint, kg m²: its own armature, and the actuator's through the gear."""
    armature = float(model.dof_armature[model.jnt_dofadr[joint]])
    actuator = actuator_of(model, joint)
    if actuator is not None:
        armature += float(model.actuator_armature[actuator] * model.actuator_gear[actuator, 0] ** 2)
    return armature


def _set_inertia(body, total: Inertia | None) -> None:
    """Set the mass of a body of the canonical chain, in principal axes."""
    body.explicitinertial = True
    if total is None:
        body.mass, body.inertia = NOTHING, np.full(3, NOTHING)
        return
    moments, axes = np.linalg.eigh(total.matrix())
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    moments = np.maximum(moments, NOTHING)
    moments[2] = min(moments[2], moments[0] + moments[1])  # rounding may exceed what MuJoCo allows a thin plate
    body.mass, body.ipos, body.iquat, body.inertia = total.mass, total.com, matrix_to_quat(axes), moments
