"""Arms of model files as people download them: made torque-driven, and what they can be asked to do."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError, ModelWarning, shown
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm
from contactsafe.robot.binding import actuators_of
from contactsafe.robot.findings import Findings
from contactsafe.robot.ik import POSITION_TOLERANCE, solve_ik
from contactsafe.robot.ik_few_joints import FEW, solve_position_first
from contactsafe.robot.missing_meshes import make_compilable
from contactsafe.robot.spec_parts import Flange, linear, read_spec
from contactsafe.robot.tool_point import find_tool
from contactsafe.robot.user_chain import joints_above
from contactsafe.robot.user_home import key_frame

MOVES_M = 0.1
"""How far the tool moves."""

_STUCK = 1e6
"""Damping of joints that are not the arm's, N m s/rad or N s/m: they stay where they are."""

_TURNED_RAD = 1e-2
"""A tool that is turned by less is not turned."""

_MARGIN_RAD = 0.25
"""Room to the ends of the joints' range beyond which more makes no move better, rad."""


@dataclass(frozen=True)
class ModelArm:
    """An arm in a model file, and what it is asked to do.

    Attributes:
        name: of its folder and file, and the tool where one was named.
        spec: the scene, torque-driven.
        arm: in it.
        move: of the tool, world, (3,), m; zeros where it reaches nothing 10 cm away.
        q_end: joint positions at the end of the move, (n,), rad.
        others: positions of the joints that are not the arm's, as its model has them, by name.
        notes: what is to be known of the model, in a line; empty for nothing.
    """

    name: str
    spec: mujoco.MjSpec
    arm: Arm
    move: np.ndarray
    q_end: np.ndarray
    others: dict[str, np.ndarray]
    notes: str


def load_model(place: str) -> ModelArm:
    """Load an arm by PATH, or by PATH:TOOL where TOOL is a site, a body, or a link of a URDF.

    Without TOOL it is the end of the longest chain of hinges; a URDF needs one. Joints that are not the arm's are
    locked where its model has them, but for those of free bodies.

    Raises:
        InvalidInputError: there is no such file, or its arm cannot be driven; with all reasons.
    """
    path, tool = _split(place)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", ModelWarning)
        spec, site, joints = _scene_of(path, tool)
        made = robots.make_torque_driven(spec, site, joints)
        arm = robots.from_mjcf(spec, made, joints)
    others = _lock_others(spec, arm)
    move, q_end = _choose_move(arm)
    name = f"{path.parent.name}/{path.stem}" + (f":{tool}" if tool else "")
    notes = "; ".join(dict.fromkeys(str(one.message) for one in told if issubclass(one.category, ModelWarning)))
    return ModelArm(name, spec, arm, move, q_end, others, notes)


def _split(place: str) -> tuple[Path, str]:
    """Return a path, and the tool that is named behind it or nothing."""
    path, tool = Path(place), ""
    if not path.is_file() and ":" in place:
        head, _, tool = place.rpartition(":")
        path = Path(head)
    if not path.is_file():
        raise InvalidInputError(f"model {shown(str(path))} is no file; give the path of an MJCF or URDF file")
    return path, tool


def _scene_of(path: Path, tool: str) -> tuple[mujoco.MjSpec, str | Flange, list[str] | None]:
    """Return the scene of a file, where the tool is, and the arm's joints where they were searched for."""
    if path.suffix.lower() == ".urdf":
        if not tool:
            raise InvalidInputError(f"'{path}' names no link of the tool; write {path}:LINK")
        return *robots.urdf_spec(path, tool), None
    spec = read_spec(path)
    if not tool:
        return spec, *find_tool(spec)
    make_compilable(spec)
    site = spec.site(tool)
    return (
        spec,
        tool if site is not None else Flange(tool),
        _hinges_to(spec, tool if site is None else site.parent.name),
    )


def _hinges_to(spec: mujoco.MjSpec, body: str) -> list[str] | None:
    """Return the hinges that move a body where a lift moves it too; None where there is nothing to choose."""
    model = spec.compile()
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body)
    moving = joints_above(model, max(found, 0))
    hinges = [joint for joint in moving if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE]
    driven = [joint for joint in hinges if actuators_of(model, joint)] or hinges
    return None if len(hinges) == len(moving) else [model.joint(joint).name for joint in driven]


def _lock_others(spec: mujoco.MjSpec, arm: Arm) -> dict[str, np.ndarray]:
    """Let joints that are not the arm's hardly move, for its model has them locked; return where."""
    own = {arm.model.joint(i).name for i in range(arm.n)}
    for joint in spec.joints:
        if joint.name not in own and joint.type != mujoco.mjtJoint.mjJNT_FREE:
            joint.damping = linear(joint.damping, _STUCK)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = spec.compile()
    data, chain = mujoco.MjData(model), [model.joint(name).id for name in own]
    key = key_frame(model, sorted(chain), None, Findings())
    if key >= 0:
        mujoco.mj_resetDataKeyframe(model, data, key)
    names = [model.joint(i).name for i in range(model.njnt)]
    return {name: data.joint(name).qpos.copy() for name in names if name not in own}


def _choose_move(arm: Arm) -> tuple[np.ndarray, np.ndarray]:
    """Return where the tool goes, 10 cm along an axis of the world where the joints allow it, and the joints there."""
    start, nominal, q = arm.tool_pose(arm.home), arm.nominal(), np.empty(arm.n)
    best = (0.0, np.zeros(3), arm.home.copy())
    search, turned = (solve_position_first, np.inf) if arm.n < FEW else (solve_ik, _TURNED_RAD)
    for move in MOVES_M * np.concatenate([np.eye(3), -np.eye(3)]):
        seed = arm.home.copy()
        for fraction in np.linspace(0.2, 1.0, 5):
            error, turn = search(
                nominal.handle, start.position + fraction * move, start.quat, seed, arm.q_min, arm.q_max, q
            )
            seed = q.copy()
        room = float(np.minimum(q - arm.q_min, arm.q_max - q).min())
        if error < POSITION_TOLERANCE and turn < turned and min(room, _MARGIN_RAD) > best[0]:
            best = (min(room, _MARGIN_RAD), move, q.copy())
    return best[1], best[2]


def pushed_at(of: ModelArm) -> tuple[str, np.ndarray]:
    """Return the body amid the arm that is pushed, and the force: 25 N or a tenth of what the arm can hold, level.

    Returns:
        Name of the body, and force, world, (3,), N.
    """
    arm = of.arm
    joint = (arm.n + 1) // 2
    data, J = mujoco.MjData(arm.model), np.zeros((3, arm.n))
    data.qpos[:] = arm.home
    mujoco.mj_forward(arm.model, data)
    body = int(arm.model.jnt_bodyid[joint])
    mujoco.mj_jacBodyCom(arm.model, data, J, None, body)
    left = np.maximum(arm.tau_max - np.abs(data.qfrc_bias), 0.0)
    holds = [(left / np.maximum(np.abs(J.T @ side), 1e-9)).min() for side in np.eye(3)[:2]]
    side = int(np.argmin(holds))
    return arm.model.joint(joint).name, min(25.0, 0.1 * holds[side]) * np.eye(3)[side]
