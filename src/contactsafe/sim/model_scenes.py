"""A model's scene, ready to be stepped, with a sphere in the path of its arm or without."""

from dataclasses import dataclass

import mujoco
import numpy as np

from contactsafe.robot.binding import Binding
from contactsafe.robot.bodies import link_of
from contactsafe.robot.spec_parts import linear, remove
from contactsafe.sim.model_arms import ModelArm

SPHERE_M, MASS_KG = 0.05, 1.0
"""Radius of what the arm meets; and its mass on springs."""

_CLEAR_M = 0.004
"""Gap between sphere and arm where they are nearest."""


@dataclass(frozen=True)
class Scene:
    """A model with something in it or not, ready to be stepped.

    Attributes:
        model: compiled.
        data: at the arm's home, all other joints where the arm's model has them locked.
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
            joint.stiffness = linear(joint.stiffness, stiffness)
            joint.damping = linear(joint.damping, 2.0 * (stiffness * MASS_KG) ** 0.5)
    body.add_geom(
        name="met_sphere", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[SPHERE_M, 0, 0], mass=MASS_KG, contype=0x7FFFFFFF,
        conaffinity=0x7FFFFFFF, condim=1, solref=[0.02, 1.0],
    )  # fmt: skip


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
