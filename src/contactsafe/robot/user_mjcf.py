"""The arm inside a user's own MJCF: a nominal model of it alone, whatever else stands in the scene.

The user's model is compiled by MuJoCo first, so that defaults, includes, meshes and inertias from geoms are resolved.
From it a canonical chain is built, as the compiled dynamics want it: one body a joint, and each body holds all that
is fixed to it. Its frames lie at the joints and are parallel to the world's while every joint is where the file puts
it; dynamics and the tool's pose do not depend on that choice.
"""

import os
from collections.abc import Sequence
from typing import Literal, TypedDict, Unpack

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.core.rotation import matrix_to_quat
from contactsafe.robot.arm import Arm, Pose, finite_array
from contactsafe.robot.bodies import inertia_of, link_of, shown_by
from contactsafe.robot.derived import NOTHING, Found, carried_tool, describe
from contactsafe.robot.description import Inertia, Joint, Tip
from contactsafe.robot.findings import Findings
from contactsafe.robot.missing_meshes import find_meshes
from contactsafe.robot.names import JOINT, SITE, find, or_flange
from contactsafe.robot.spec_parts import Flange, add_flange, become_motor, compiled_spec, read_spec
from contactsafe.robot.surface import geom_surface
from contactsafe.robot.torque_driven import torque_driven_copy
from contactsafe.robot.user_chain import choose_chain, refuse_tied, refuse_weightless
from contactsafe.robot.user_home import at_start, check_held, checked_home, key_frame, usual_home
from contactsafe.robot.user_limits import declared_friction, joint_range, rotor, torque_limits, torque_rate
from contactsafe.robot.user_notes import note_home, note_unserved

_GRAVITY_MAX = 1e3  # m/s²
_HINGE = mujoco.mjtJoint.mjJNT_HINGE
_LEVER_DOUBTED = 0.02
"""Of `Arm.lever_doubted`, m. Many arms are bent in one plane, where a push from the side fits points everywhere."""


class ArmOptions(TypedDict, total=False):
    """What may be told of the arm in a model, beside where it is; all of it may be left out.

    Attributes:
        actuators: "torque" to take the model as `contactsafe.robots.make_torque_driven` edits it.
        tau_max: torque limits, (n,), N m; None for the model's own: forcerange and, of motors, ctrlrange, times gear,
            and actuatorfrcrange of joints. Where both are given, the smaller holds.
        torque_rate_max: N m/s; None for the strongest motor's limit in 87 ms, as on a Panda, and at least 1000.
        friction: φ1 N m, φ2 s/rad, φ3 rad/s of every joint (`contactsafe.robot.friction`), (n, 3), in place of the
            file's damping and frictionloss; None for those.
        home: a posture well inside the limits, (n,), rad; or a key frame by its name or how it begins; None for 'home',
            with the prefix of the joints, or the only key frame, or what `usual_home` chooses.
        tip: the part of the tool that works, its face centred on the site; None where no part is meant to. It counts in
            simulated worlds alone.
    """

    actuators: Literal["torque"] | None
    tau_max: ArrayLike | None
    torque_rate_max: float | None
    friction: ArrayLike | None
    home: ArrayLike | str | None
    tip: Tip | None


def from_mjcf(
    scene: str | os.PathLike | mujoco.MjModel | mujoco.MjSpec,
    site: str | Flange | None = None,
    joints: Sequence[str] | None = None,
    **options: Unpack[ArmOptions],
) -> Arm:
    """Return the arm inside a user's own MJCF scene.

    The scene may hold anything else: tables, objects, a gripper, other robots. What is fixed to a link counts as part
    of it, and joints that are not the arm's are locked where the key frame of home has them, or where the model starts.
    Base pose, gravity, rotor inertia, damping and frictionloss are the model's; of the last two 80 % are expected and
    compensated, and detection allows for the rest (`contactsafe.robot.user_limits`). The arm's surface is that of the
    colliding geoms of links 2 … n, or all geoms of a link where none collides, without what the last link carries.

    Args:
        scene: path of the MJCF file, its `MjSpec`, which stays as it is, or the model compiled from it.
        site: end-effector point, its axes are the tool's; or a `Flange` to make one, but in a compiled model. Without
            it the error names those that there are.
        joints: names of the arm's hinges from base to tip; None for all that move the site, if each has an actuator.
        **options: see `ArmOptions`.

    Returns:
        An arm with the description and the tool that simulated worlds build it from. Limits that the model does not
        give are inf, as those of speed.

    Raises:
        InvalidInputError: the file cannot be read, a name is unknown, a joint is no hinge or does not move the
            site, the choice of joints or actuators is ambiguous, torque limits are missing or do not carry the arm at
            home, a body of the arm carries its own weight (gravcomp), an equality constraint ties the arm, or gravity
            or a range is no number. All that is found is told at once.
    """
    refuse_options(options)
    torque, findings = options.get("actuators") is not None, Findings()
    if isinstance(scene, mujoco.MjModel):
        model, name, otherwise = scene, _site_of(site), ""
    else:
        spec, what = _spec(scene)
        if torque:
            spec, name = torque_driven_copy(spec, site, joints, options.get("tau_max"), findings)
        else:
            find_meshes(spec, findings)
            name = add_flange(spec, site)
        model = compiled_spec(spec, what)
        otherwise = or_flange(model)
    return arm_in(model, find(model, SITE, name, otherwise), joints, options, findings)


def arm_in(
    model: mujoco.MjModel, site_id: int, joints: Sequence[str] | None, options: ArmOptions, findings: Findings
) -> Arm:
    """Return the arm in a compiled scene, and tell what was found; see `from_mjcf`."""
    torque = options.get("actuators") is not None
    chain = choose_chain(model, site_id, joints, findings, many=torque)
    if not torque:
        refuse_weightless(model, chain, findings)
    refuse_tied(model, chain, findings, may_be_led=torque)
    arm = _arm(Found(model, mujoco.MjData(model), chain, site_id), options, findings)
    findings.warn(arm.name)
    return arm


def refuse_options(options: ArmOptions) -> None:
    """Refuse what is no option of an arm.

    Raises:
        TypeError: a keyword is unknown.
        InvalidInputError: `actuators` is none of what it may be.
    """
    unknown = sorted(set(options) - set(ArmOptions.__annotations__))
    if unknown:
        raise TypeError(
            f"unexpected keyword argument {unknown[0]!r}; there are {', '.join(ArmOptions.__annotations__)}"
        )
    if options.get("actuators") not in (None, "torque"):
        raise InvalidInputError(
            f"actuators = {shown(options['actuators'])}; give 'torque' to replace servos by motors, or None"
        )


def _arm(found: Found, options: ArmOptions, findings: Findings) -> Arm:
    """Build the arm whose joints are known, or tell all that is wrong with it."""
    model, chain, n = found.model, found.chain, len(found.chain)
    q_min, q_max = joint_range(model, chain)
    limits = torque_limits(model, chain, options.get("tau_max"), findings)
    asked, key = options.get("home"), -1
    with findings.noting():
        wanted = asked if isinstance(asked, str) else None
        key = key_frame(model, chain, wanted, Findings() if asked is not None else findings)
    data, key_home = at_start(model, chain, key)
    given = key_home if asked is None or isinstance(asked, str) else asked
    home = checked_home(given, q_min, q_max, findings)
    rate = 1.0
    with findings.noting():
        rate = torque_rate(options.get("torque_rate_max"), limits)
    found = found._replace(data=data)
    nominal = _nominal_model(model, data, chain, found.site, limits)
    if given is None:
        home = usual_home(model, chain, nominal, (q_min, q_max), limits)
    friction, drag, unknown = _friction(found, limits, nominal, options.get("friction"), findings)
    if np.linalg.norm(nominal.opt.gravity) < _GRAVITY_MAX:  # or the arm is refused for that
        meant = key >= 0 or asked is not None
        check_held(model, chain, (_gravity(nominal, home), limits), meant, findings)
    findings.raise_problems()
    name = model.names.split(b"\0")[0].decode()
    description = describe(found, name, _joints(nominal, q_min, q_max, limits, friction), rate, home)
    surface, tool = (
        geom_surface(model, data, shown_by(model, chain), data.xanchor[chain]),
        carried_tool(found, options.get("tip")),
    )
    note_home(model, data, chain, home, findings)
    note_unserved(model, chain, nominal, home, findings)
    base = model.body_parentid[model.jnt_bodyid[chain[0]]]
    return Arm(
        name, nominal, str(mujoco.mj_id2name(model, SITE, found.site)), q_min, q_max, np.full(n, np.inf), limits, rate,
        friction, home, description, tool, surface, _LEVER_DOUBTED, drag=drag, friction_unknown=unknown,
        base=Pose(data.xpos[base].copy(), data.xquat[base].copy()),
    )  # fmt: skip


def _friction(
    found: Found, limits: np.ndarray, nominal: mujoco.MjModel, given: ArrayLike | None, findings: Findings
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return friction, drag and unknown friction as of `Arm`: those given, or the file's."""
    n = len(found.chain)
    friction = np.zeros((n, 3))
    if given is None:
        return friction, *declared_friction(found.model, found.chain, limits, nominal, findings)
    with findings.noting():
        friction = finite_array(given, (n, 3), "friction")
    return friction, np.zeros((n, 3)), np.zeros((n, 2))


def _gravity(nominal: mujoco.MjModel, q: np.ndarray) -> np.ndarray:
    """Return the torque that holds an arm at q (n,), (n,), N m."""
    data = mujoco.MjData(nominal)
    data.qpos[:] = q
    mujoco.mj_forward(nominal, data)
    return data.qfrc_bias.copy()


def _joints(
    nominal: mujoco.MjModel, q_min: np.ndarray, q_max: np.ndarray, tau_max: np.ndarray, friction: np.ndarray
) -> tuple[Joint, ...]:
    """Return what the description says of each joint; the arguments have one row a joint."""
    rows = zip(q_min, q_max, tau_max, friction, nominal.dof_armature, strict=True)
    return tuple(
        Joint(float(low), float(high), np.inf, float(most), tuple(phi.tolist()), float(rotor))
        for low, high, most, phi, rotor in rows
    )


def _site_of(site: str | Flange | None) -> str | None:
    if isinstance(site, Flange):
        raise InvalidInputError(
            "a compiled MjModel takes no more sites; give the path or the MjSpec with the Flange, or a site's name"
        )
    return site


def _spec(scene: object) -> tuple[mujoco.MjSpec, str]:
    """Read a scene to be edited, and say what it is called in messages."""
    if isinstance(scene, mujoco.MjSpec):
        return scene.copy(), "the MjSpec"
    if not isinstance(scene, (str, os.PathLike)) or not os.path.isfile(scene):
        raise InvalidInputError(
            f"no file at '{str(scene)[:80]}'; give the path of an MJCF file, a mujoco.MjSpec, or a compiled "
            "mujoco.MjModel"
        )
    path = os.fspath(scene)
    if path.lower().endswith(".urdf"):
        raise InvalidInputError(f"'{path}' is a URDF; give it to robots.from_urdf")
    return read_spec(path), f"'{path}'"


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
            armature=rotor(model, joint),
        )
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        become_motor(motor, limit)
    quat = matrix_to_quat(data.site_xmat[site_id].reshape(3, 3))
    body.add_site(name=mujoco.mj_id2name(model, SITE, site_id), pos=data.site_xpos[site_id] - origin, quat=quat)
    return spec.compile()


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
