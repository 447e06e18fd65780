"""A base that stands elsewhere than the model has it, or moves: on a lift, a gantry, a mobile platform."""

import copy
import math
import pickle

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.control.plant import STIFFNESS, UNTOUCHED
from tests.robot.worlds import cell

from contactsafe import Controller, Measurement, Payload, Pose, Target, presets, robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.franka import HAND
from contactsafe.robot.mjcf import arm_mjcf
from contactsafe.robot.panda import PANDA

HOME_POSE = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
HERE, THERE = (0.4, -0.3, 0.8), (-0.2, 0.5, 0.3)
TURN, TURNED = (0.9, 0.1, -0.3, 0.2), (0.6, -0.2, 0.1, 0.7)


def arm_at(position, turn):
    return robots.from_mjcf(cell(position, turn), site="left/tcp")


def driven(controller, arm, ticks=60):
    """Swing about home under a target beside the tool; return torque, error and residual of every tick."""
    rows = []
    start = arm.tool_pose(arm.home)
    target = Target(Pose(start.position + np.array([0.02, 0.0, 0.01]), start.quat), STIFFNESS)
    for k in range(ticks):
        q, qd = arm.home + 0.01 * np.sin(0.02 * k + np.arange(7)), 0.2 * np.cos(0.02 * k + np.arange(7))
        out = controller.step(Measurement(q, qd, UNTOUCHED), target)
        rows.append(np.concatenate([out.torque, out.error, out.residual]))
    return np.array(rows)


LOAD = Payload(0.7, np.array([0.01, 0.0, 0.04]), np.eye(3) * 1e-3)
THERE_POSE = Pose(np.array(THERE), np.array(TURNED) / np.linalg.norm(TURNED))
TOLD = {
    "base": lambda one: one.set_base(THERE_POSE),
    "base, payload": lambda one: (one.set_base(THERE_POSE), one.set_payload(*LOAD)),
    "payload, base": lambda one: (one.set_payload(*LOAD), one.set_base(THERE_POSE)),
    "base, copy": lambda one: one.set_base(THERE_POSE),
}


@pytest.mark.parametrize("order", TOLD)
def test_a_base_that_was_moved_needed_a_new_controller(order):
    """Told, or built there: the same."""
    built = arm_at(THERE, TURNED)
    told, model = Controller(arm_at(HERE, TURN)), Controller(built)
    TOLD[order](told)
    if "payload" in order:
        model.set_payload(*LOAD)
    if "copy" in order:
        told = pickle.loads(pickle.dumps(told))
    for one in (told, model):
        one.reset(built.home)
    assert_allclose(driven(told, built), driven(model, built), rtol=1e-6, atol=1e-6)


def test_a_copy_knows_how_the_base_moves(panda):
    moving = Controller(panda)
    moving.set_base(THERE_POSE, np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.3]))
    for one in (copy.copy(moving), pickle.loads(pickle.dumps(moving))):
        for name in ("base_position", "base_twist", "gravity"):
            assert_array_equal(one.record["handle"][name], moving.record["handle"][name])


def platform():
    """A Panda on a platform far heavier than itself, which slides and lifts."""
    spec = mujoco.MjSpec()
    spec.option.timestep = 0.001
    cart = spec.worldbody.add_body(name="platform", mass=1e7, inertia=[1e7] * 3, gravcomp=1.0)
    for axis in ([1, 0, 0], [0, 0, 1]):
        cart.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    panda = mujoco.MjSpec.from_string(arm_mjcf(PANDA, HAND))
    panda.option.cone, panda.option.jacobian = spec.option.cone, spec.option.jacobian  # or MuJoCo warns
    spec.attach(panda, prefix="its_", frame=cart.add_frame())
    model = spec.compile()
    joints = [model.joint(i).name for i in range(2, model.njnt)]
    return model, robots.from_mjcf(model, site="its_tcp", joints=joints)


def hold_while_it_moves(tell, preset=presets.safe, seconds=3.0, size=0.05, rate=2.0 * math.pi * 0.5):
    """Hold the tool while the platform sways and lifts; return how far it is off, (ticks,), m, and whether touched."""
    model, arm = platform()
    data, at, controller = mujoco.MjData(model), arm.bind(model), Controller(arm, preset())
    data.qpos[at.qpos] = arm.home
    data.qvel[:2] = [size * rate, 0.5 * size * rate]
    mujoco.mj_forward(model, data)
    controller.reset(arm.home)
    start = arm.tool_pose(arm.home)
    target = Target(start, np.array([300.0] * 3 + [400.0] * 3))
    off, touched = [], 0
    base = data.body("platform")
    for k in range(int(1000 * seconds)):
        phase = 0.001 * k * rate
        velocity = np.array([size * rate * math.cos(phase), 0.0, 0.5 * size * rate * math.cos(phase), 0.0, 0.0, 0.0])
        tell(controller, Pose(base.xpos.copy(), base.xquat.copy()), velocity)
        out = controller.step(Measurement(data.qpos[at.qpos], data.qvel[at.dof], UNTOUCHED), target)
        data.ctrl[at.ctrl] = out.torque / at.gear
        data.qfrc_applied[:2] = -1e7 * rate * rate * size * math.sin(phase) * np.array([1.0, 0.5])
        mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        off.append(np.linalg.norm(data.site("its_tcp").xpos - start.position))
        touched += out.contact.in_contact
    return np.array(off), touched


@pytest.mark.parametrize("preset", [presets.safe, presets.vices])
def test_the_tool_stays_while_the_base_moves_under_it(preset):
    def tell(controller, pose, velocity):
        controller.set_base(pose, velocity)

    off, touched = hold_while_it_moves(tell, preset)
    assert off[500:].max() < 0.001  # at first the arm, at rest on a moving base, goes along
    assert touched == 0


def test_a_base_that_moves_untold_carries_the_tool_along():
    off, _ = hold_while_it_moves(lambda controller, pose, velocity: None, seconds=1.0)
    assert off.max() > 0.03


def test_velocities_tell_the_acceleration_and_a_reset_forgets_it(panda):
    controller = Controller(panda)
    controller.reset(panda.home)
    for k in range(200):
        controller.set_base(HOME_POSE, np.array([2.0 * 0.001 * k, 0.0, 0.0, 0.0, 0.0, 0.0]))
        controller.step(Measurement(panda.home, np.zeros(7), UNTOUCHED))
    assert_allclose(controller.record["handle"]["gravity"], [-2.0, 0.0, -9.81], atol=0.05)
    controller.reset(panda.home)
    assert_allclose(controller.record["handle"]["gravity"], [0.0, 0.0, -9.81], atol=1e-9)
    controller.set_base(HOME_POSE, np.zeros(6))
    assert_allclose(controller.record["handle"]["gravity"], [0.0, 0.0, -9.81], atol=1e-9)


def test_a_reset_lost_the_acceleration_that_was_told_at_the_next_payload(panda):
    controller = Controller(panda)
    controller.set_base(HOME_POSE, np.zeros(6), np.array([0.0, 0.0, 2.0]))
    controller.reset(panda.home)
    controller.set_payload(0.2)
    assert_allclose(controller.record["handle"]["gravity"], [0.0, 0.0, -11.81], atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("here",), "pose is str; give a contactsafe.Pose"),
        ((Pose([0, 0, np.nan], [1, 0, 0, 0]),), "pose.position"),
        ((Pose([0, 0, 0], [1, 1, 0, 0]),), "pose.quat has length 1.414; give a unit quaternion"),
        ((Pose([0, 0, 0], [1, 0, 0, 0]), np.zeros(3)), "velocity has shape"),
        ((Pose([0, 0, 0], [1, 0, 0, 0]), np.zeros(6), np.zeros(6)), "acceleration has shape"),
    ],
)
def test_what_is_no_base_is_refused_and_the_last_one_holds(panda, arguments, text):
    controller = Controller(panda)
    controller.reset(panda.home)
    before = controller.record["handle"].copy()
    with pytest.raises(InvalidInputError, match=text):
        controller.set_base(*arguments)
    assert controller.record["handle"] == before


def test_a_sensor_under_a_base_that_was_moved_is_refused(panda):
    controller = Controller(panda)
    controller.set_base(Pose(np.array([0.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0, 0.0])))
    controller.reset(panda.home)
    with pytest.raises(InvalidInputError, match="wrench_base is known for a base that stands"):
        controller.step(Measurement(panda.home, np.zeros(7), UNTOUCHED, wrench_base=np.zeros(6)))
