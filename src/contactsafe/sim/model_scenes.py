"""Models of arms as people download them: made torque-driven, and set into a scene with something in their path."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError, ModelWarning, shown
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm
from contactsafe.robot.binding import Binding
from contactsafe.robot.bodies import link_of
from contactsafe.robot.findings import Findings
from contactsafe.robot.ik import POSITION_TOLERANCE, solve_ik
from contactsafe.robot.spec_parts import Flange, remove
from contactsafe.robot.tool_point import find_tool
from contactsafe.robot.user_home import key_frame

MOVES_M = 0.1
"""How far the tool moves."""

SPHERE_M, MASS_KG = 0.05, 1.0
"""Radius of what the arm meets; and its mass on springs."""

_STUCK = 1e6
"""Damping of joints that are not the arm's, N m s/rad or N s/m: they stay where the file has them."""

_CLEAR_M, _MARGIN_RAD = 0.004, 0.25


@dataclass(frozen=True)
class ModelArm:
    """An arm in a model file, and what it is asked to do.

    Attributes:
        name: of the file, or of its folder where many files have that name.
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
    site: str | Flange
    joints: list[str] | None = None
    if path.suffix.lower() == ".urdf":
        if not tool:
            raise InvalidInputError(f"'{place}' names no link of the tool; write {path}:LINK")
        spec, site = robots.urdf_spec(path, tool)
    else:
        spec = _read(path)
        site, joints = _tool_of(spec, tool)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", ModelWarning)
        made = robots.make_torque_driven(spec, site, joints)
        arm = robots.from_mjcf(spec, made, joints)
    others = _lock_others(spec, arm)
    move, q_end = _choose_move(arm)
    name = f"{path.parent.name}/{path.stem}" + (f":{tool}" if tool else "")
    notes = "; ".join(str(one.message) for one in told if issubclass(one.category, ModelWarning))
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


def _read(path: Path) -> mujoco.MjSpec:
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise InvalidInputError(f"MuJoCo cannot read {path}: {' '.join(str(error).split())}; mend the file") from None


def _tool_of(spec: mujoco.MjSpec, tool: str) -> tuple[str | Flange, list[str] | None]:
    """Return where the tool is, and the arm's joints where they were searched for."""
    if not tool:
        return find_tool(spec)
    return (tool if spec.site(tool) is not None else Flange(tool)), None


def _lock_others(spec: mujoco.MjSpec, arm: Arm) -> dict[str, np.ndarray]:
    """Let joints that are not the arm's hardly move, for its model has them locked; return where."""
    own = {arm.model.joint(i).name for i in range(arm.n)}
    for joint in spec.joints:
        if joint.name not in own and joint.type != mujoco.mjtJoint.mjJNT_FREE:
            joint.damping = _linear(joint.damping, _STUCK)
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
    for move in MOVES_M * np.concatenate([np.eye(3), -np.eye(3)]):
        seed = arm.home.copy()
        for fraction in np.linspace(0.2, 1.0, 5):
            error, turn = solve_ik(
                nominal.handle, start.position + fraction * move, start.quat, seed, arm.q_min, arm.q_max, q
            )
            seed = q.copy()
        room = float(np.minimum(q - arm.q_min, arm.q_max - q).min())
        if error < POSITION_TOLERANCE and turn < 1e-2 and min(room, _MARGIN_RAD) > best[0]:
            best = (min(room, _MARGIN_RAD), move, q.copy())
    return best[1], best[2]


@dataclass(frozen=True)
class Scene:
    """A model with something in it or not, ready to be stepped.

    Attributes:
        model: compiled.
        data: at the arm's home, everything else where the file has it.
        at: where the arm is in it.
        sphere: its geom; -1 for none.
        site: the tool point.
        base: bodies that the arm cannot move.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    at: Binding
    sphere: int
    site: str
    base: np.ndarray

    @property
    def tool(self) -> np.ndarray:
        """Where the tool point is, world, (3,), m."""
        return self.data.site(self.site).xpos

    @property
    def q(self) -> np.ndarray:
        """Joint positions, (n,), rad."""
        return self.data.qpos[self.at.qpos]

    @property
    def qd(self) -> np.ndarray:
        """Joint velocities, (n,), rad/s."""
        return self.data.qvel[self.at.dof]

    def step(self, torque: np.ndarray) -> None:
        """Apply joint torques (n,) in N m for a millisecond."""
        self.data.ctrl[self.at.ctrl] = torque / self.at.gear
        mujoco.mj_step(self.model, self.data, self.at.steps)

    def push(self, joint: str, force: np.ndarray) -> None:
        """Push the body that a joint moves, at its centre of mass, from now on; force in world axes, (3,), N."""
        self.data.xfrc_applied[self.model.joint(joint).bodyid[0], :3] = force

    def force_on_sphere(self) -> float:
        """Return how hard the sphere is pressed, N; 0 without one."""
        if self.sphere < 0:
            return 0.0
        wrench, total = np.zeros(6), np.zeros(3)
        for i in range(self.data.ncon):
            contact = self.data.contact[i]
            if self.sphere in contact.geom and not self.base[self.model.geom_bodyid[contact.geom]].any():
                mujoco.mj_contactForce(self.model, self.data, i, wrench)
                sign = 1.0 if contact.geom[1] == self.sphere else -1.0
                total += sign * contact.frame.reshape(3, 3).T @ wrench[:3]
        return float(np.linalg.norm(total))


def build_scene(of: ModelArm, centre: np.ndarray | None = None, stiffness: float = np.inf) -> Scene:
    """Compile a model, with a sphere in its scene where one is wanted.

    Args:
        of: the arm.
        centre: of the sphere, world, (3,), m; None for none.
        stiffness: of the springs that hold it, N/m; inf for one that is fixed.
    """
    spec = of.spec.copy()
    for key in list(spec.keys):
        remove(spec, key)  # they do not know the sphere's joints
    if centre is not None:
        _add_sphere(spec, centre, stiffness)
    model = spec.compile()
    data, at = mujoco.MjData(model), of.arm.bind(model)
    for name, position in of.others.items():
        data.joint(name).qpos[:] = position
    data.qpos[at.qpos] = of.arm.home
    mujoco.mj_forward(model, data)
    chain = [model.joint(of.arm.model.joint(i).name).id for i in range(of.arm.n)]
    moved = link_of(model, chain) > 0
    base = ~moved
    if centre is None:
        return Scene(model, data, at, -1, of.arm.site, base)
    base[model.body("met").id] = False
    return Scene(model, data, at, model.geom("met_sphere").id, of.arm.site, base)


def _add_sphere(spec: mujoco.MjSpec, centre: np.ndarray, stiffness: float) -> None:
    """Add a sphere that meets all that collides, on springs or fixed; little of it bounces."""
    body = spec.worldbody.add_body(name="met", pos=centre, gravcomp=1.0)
    if np.isfinite(stiffness):
        for axis in np.eye(3):
            joint = body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
            joint.limited, joint.frictionloss = mujoco.mjtLimited.mjLIMITED_FALSE, 0.0
            joint.stiffness = _linear(joint.stiffness, stiffness)
            joint.damping = _linear(joint.damping, 2.0 * (stiffness * MASS_KG) ** 0.5)
    body.add_geom(
        name="met_sphere", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[SPHERE_M, 0, 0], mass=MASS_KG, contype=0x7FFFFFFF,
        conaffinity=0x7FFFFFFF, condim=1, solref=[0.02, 1.0],
    )  # fmt: skip


def _linear(like: float | np.ndarray, value: float) -> float | list[float]:
    """Return a linear coefficient as an `MjSpec` has it: newer versions have those of higher orders behind it."""
    return value if np.ndim(like) == 0 else [value, *(np.size(like) - 1) * (0.0,)]


def sphere_in_path(of: ModelArm, q: np.ndarray) -> np.ndarray | None:
    """Place a sphere in the path of the middle of an arm.

    Args:
        of: the arm.
        q: its joint positions as it moves freely, one row a tick, (T, n), rad.

    Returns:
        Its centre, world, (3,), m; None where no point of the arm moves outwards.
    """
    arm, halfway = of.arm, len(q) // 2
    surface = arm.surface[arm.surface[:, 0] > arm.n // 2]
    if not len(surface):
        return None
    data = mujoco.MjData(arm.model)
    frames = []
    for tick in (0, halfway, halfway + len(q) // 10):
        data.qpos[:] = q[tick]
        mujoco.mj_kinematics(arm.model, data)
        bodies = arm.model.jnt_bodyid[surface[:, 0].astype(int) - 1]
        R = data.xmat[bodies].reshape(-1, 3, 3)
        points = data.xpos[bodies] + np.einsum("pij,pj->pi", R, surface[:, 1:4])
        frames.append((points, np.einsum("pij,pj->pi", R, surface[:, 4:7])))
    (first, _), (points, normals), (later, _) = frames
    centres = points + (SPHERE_M + _CLEAR_M) * normals
    outwards = np.einsum("pi,pi->p", later - points, normals)
    clear = np.array([np.linalg.norm(first - centre, axis=1).min() > SPHERE_M + _CLEAR_M for centre in centres])
    outwards[~clear] = -1.0
    return centres[outwards.argmax()] if outwards.max() > 0.002 else None


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
