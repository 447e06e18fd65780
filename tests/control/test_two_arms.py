"""Two arms in one scene, a controller each: neither minds the other, and where they meet both are gentle."""

import mujoco
import numpy as np
from tests.control.plant import STIFFNESS, UNTOUCHED

from contactsafe import Controller, Measurement, Pose, Target, presets, robots
from contactsafe.robot.franka import HAND
from contactsafe.robot.mjcf import arm_mjcf
from contactsafe.robot.panda import PANDA

SIDES = ("left", "right")


class Pair:
    """Two Pandas side by side, 0.4 m apart, each held by a controller of its own."""

    def __init__(self, preset):
        spec = mujoco.MjSpec()
        spec.option.timestep = 0.001
        for side, y in zip(SIDES, (0.2, -0.2), strict=True):
            panda = mujoco.MjSpec.from_string(arm_mjcf(PANDA, HAND))
            panda.option.cone, panda.option.jacobian = spec.option.cone, spec.option.jacobian  # or MuJoCo warns
            for geom in panda.geoms:  # each meets the other, none itself
                geom.contype, geom.conaffinity = (4, 8) if side == "left" else (8, 4)
            spec.attach(panda, prefix=f"{side}_", frame=spec.worldbody.add_frame(pos=[0.0, y, 0.0]))
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.arms = [robots.from_mjcf(self.model, site=f"{side}_tcp") for side in SIDES]
        self.at = [arm.bind(self.model) for arm in self.arms]
        self.controllers = [Controller(arm, preset()) for arm in self.arms]
        for arm, at, controller in zip(self.arms, self.at, self.controllers, strict=True):
            self.data.qpos[at.qpos] = arm.home
            controller.reset(arm.home)
        mujoco.mj_forward(self.model, self.data)
        self.start = [arm.tool_pose(arm.home) for arm in self.arms]

    def tools(self):
        """Where the tools are, (2, 3), m."""
        return np.array([self.data.site(arm.site).xpos for arm in self.arms])

    def run(self, ticks, offset=(0.0, 0.0, 0.0)):
        """Move the left target by an offset, steadily, while the right one stays; return forces, modes of contact."""
        forces, touched = np.zeros(ticks), np.zeros((ticks, 2))
        for k in range(ticks):
            aims = [np.asarray(offset) * min(1.0, k / 1000.0), np.zeros(3)]
            for i, (arm, at, controller) in enumerate(zip(self.arms, self.at, self.controllers, strict=True)):
                target = Target(Pose(self.start[i].position + aims[i], self.start[i].quat), STIFFNESS)
                out = controller.step(Measurement(self.data.qpos[at.qpos], self.data.qvel[at.dof], UNTOUCHED), target)
                self.data.ctrl[at.ctrl] = out.torque / at.gear
                touched[k, i] = out.contact.in_contact
                assert np.abs(out.torque).max() <= arm.tau_max.max()
            mujoco.mj_step(self.model, self.data)
            mujoco.mj_kinematics(self.model, self.data)
            forces[k] = self.force()
        return forces, touched

    def force(self):
        """Largest force between two bodies that touch, N."""
        wrench, largest = np.zeros(6), 0.0
        for j in range(self.data.ncon):
            mujoco.mj_contactForce(self.model, self.data, j, wrench)
            largest = max(largest, float(np.linalg.norm(wrench[:3])))
        return largest


def test_a_push_on_one_arm_is_none_on_the_other():
    pair = Pair(presets.safe)
    before = pair.tools()
    pair.data.xfrc_applied[pair.model.body("left_link5").id, :3] = [0.0, 0.0, -25.0]
    _, touched = pair.run(1500)
    off = np.linalg.norm(pair.tools() - before, axis=1)
    assert touched[:, 0].mean() > 0.9
    assert touched[:, 1].max() == 0
    assert off[0] < 0.01
    assert off[1] < 1e-3


def test_arms_that_meet_feel_each_other_and_press_less_than_stiff_ones():
    steady = {}
    for preset in (presets.vices, presets.safe):
        pair = Pair(preset)
        forces, touched = pair.run(2500, offset=(0.0, -0.35, 0.0))
        assert forces.max() > 5.0  # they met
        steady[preset.__name__] = forces[-500:].mean()
    assert touched.max(axis=0).tolist() == [1, 1]
    assert steady["safe"] < 0.5 * steady["vices"]
