"""The smallest worlds that show a law: the nominal model as plant, stepped through MuJoCo's public API."""

import math

import mujoco
import numpy as np

from contactsafe import Controller, Measurement, Pose, Target
from contactsafe.robot.mjcf import arm_mjcf

STIFFNESS = np.full(6, 150.0)

UNTOUCHED = np.zeros(6)
"""What a force sensor reads while nothing touches the tool."""


class Plant:
    """An arm without friction, noise or delay; xfrc_applied pushes it, and springs may stand in its path.

    Args:
        arm: whose model is the plant, unless another is given.
        q: where it starts, at rest, (n,), rad.
        model: of a world whose first joints are the arm's.
    """

    def __init__(self, arm, q=None, model=None):
        self.arm = arm
        self.model = arm.model if model is None else model
        self.data = mujoco.MjData(self.model)
        self.data.qpos[: arm.n] = arm.home if q is None else q
        mujoco.mj_forward(self.model, self.data)

    @property
    def q(self):
        return self.data.qpos[: self.arm.n].copy()

    @property
    def qd(self):
        return self.data.qvel[: self.arm.n].copy()

    def push(self, body, force):
        """Push a body at its centre of mass with a force in world axes, N, from now on."""
        self.data.xfrc_applied[self.model.body(body).id, :3] = force

    def push_torque(self):
        """Give Jᵀ F of all pushes, (n,), N m."""
        torque = np.zeros(self.model.nv)
        for body in range(1, self.model.nbody):
            J = np.zeros((3, self.model.nv))
            mujoco.mj_jacBodyCom(self.model, self.data, J, None, body)
            torque += J.T @ self.data.xfrc_applied[body, :3]
        return torque[: self.arm.n]

    def tool_position(self):
        return self.data.site(self.arm.site).xpos.copy()

    def step(self, torque):
        """Apply a joint torque for one millisecond."""
        self.data.qfrc_applied[: self.arm.n] = torque
        mujoco.mj_step(self.model, self.data)
        mujoco.mj_kinematics(self.model, self.data)  # or positions would be those before the step
        mujoco.mj_comPos(self.model, self.data)

    def run(self, controller, target, ticks, wrench_ee=None, each=None):
        """Let a controller drive; `each` sees every output before it acts. Gives the last output."""
        out = None
        for _ in range(ticks):
            out = controller.step(Measurement(self.q, self.qd, wrench_ee), target)
            if each is not None:
                each(out)
            self.step(out.torque)
        return out


def controller_at(arm, config, q=None, **options):
    """Make a controller, reset where the arm stands."""
    controller = Controller(arm, config, **options)
    controller.reset(arm.home if q is None else q)
    return controller


def hold(arm, q=None):
    """Make the target that asks for nothing: stay where q puts the tool."""
    q = arm.home if q is None else q
    return Target(arm.tool_pose(q), STIFFNESS, posture=q)


def reach(arm, offset):
    """Make the target that asks for the home pose moved by an offset, m, posture left at home."""
    target = hold(arm)
    return target._replace(pose=Pose(target.pose.position + np.asarray(offset), target.pose.quat))


def wrist_meets_sphere(arm, gap, stiffness):
    """Put a sphere on a spring of stiffness, N/m, beside the wrist of an arm at home, a gap of metres away in +y."""
    wrist = Plant(arm).data.body("link5").xpos
    return Plant(arm, model=with_sphere(arm, wrist + np.array([0.0, 0.16 + gap, 0.0]), stiffness))


def with_sphere(arm, centre, stiffness, mass=1.0, radius=0.05):
    """Add to an arm's model a sphere that a spring holds along each world axis, N/m; it bounces little.

    The arm's own degrees of freedom stay the first.
    """
    spec = mujoco.MjSpec.from_string(arm_mjcf(arm.description, arm.tool))
    spec.option.gravity = arm.model.opt.gravity
    body = spec.worldbody.add_body(name="sphere", pos=centre, gravcomp=1.0)
    for axis in np.eye(3):
        joint = body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        joint.stiffness = [stiffness, 0.0, 0.0]
        joint.damping = [2.0 * math.sqrt(stiffness * mass), 0.0, 0.0]
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0], mass=mass, contype=1, conaffinity=2, condim=1,
        solref=[0.004, 1.0],
    )  # fmt: skip
    return spec.compile()
