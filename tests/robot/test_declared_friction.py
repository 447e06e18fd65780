"""Damping, frictionloss and rotors that a file declares are part of the arm, and stiction is no contact."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.robot.worlds import SIX

import contactsafe as cs
from contactsafe import robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.user_limits import FRICTION_FRACTION

DAMPING = [2.0, 2.0, 1.5, 1.0, 1.0, 1.0]
LOSS = [1.1, 1.1, 1.1, 0.7, 0.4, 0.3]


def rubbing(damping=DAMPING, loss=LOSS):
    """Return the six-joint arm with losses in its joints, N m s/rad and N m."""
    model = mujoco.MjModel.from_xml_string(SIX)
    model.dof_damping[:], model.dof_frictionloss[:] = damping, loss
    return model


def test_damping_and_frictionloss_of_the_file_were_left_out():
    arm = robots.from_mjcf(rubbing(), "tip")
    assert_allclose(arm.drag[:, 0], FRICTION_FRACTION * np.array(DAMPING))
    assert_allclose(arm.drag[:3, 2], FRICTION_FRACTION * np.array(LOSS[:3]))  # the others are lighter
    assert not arm.drag[:, 1].any()
    assert_allclose(arm.friction_unknown[:, 0], (1.0 - FRICTION_FRACTION) * np.array(DAMPING))
    assert_array_equal(arm.friction_unknown[:, 1], LOSS)


def test_friction_that_is_given_stands_in_place_of_the_files():
    given = np.tile([1.0, 5.0, 0.0], (6, 1))
    arm = robots.from_mjcf(rubbing(), "tip", friction=given)
    assert_array_equal(arm.friction, given)
    assert not arm.drag.any()
    assert not arm.friction_unknown.any()


def test_damping_of_an_actuator_counts_through_its_gear():
    if not hasattr(mujoco.MjModel, "actuator_damping"):
        pytest.skip("this MuJoCo has no damping of actuators")
    model = rubbing(loss=np.zeros(6))
    model.actuator_damping[2] = 1e-4  # gear 100
    assert_allclose(robots.from_mjcf(model, "tip").drag[2, 0], FRICTION_FRACTION * 2.5)


def test_compensation_of_dry_friction_flung_a_light_joint():
    """16 N m s/rad of negative damping where the joint's inertia takes one: 5.9 rad/s in an xarm7's last joint."""
    model = rubbing()
    model.dof_armature[:] = 1e-3
    arm = robots.from_mjcf(model, "tip")
    assert arm.drag[5, 2] < 0.1 * FRICTION_FRACTION * LOSS[5]
    assert arm.friction_unknown[5, 1] == LOSS[5]


def test_joint_that_its_motor_cannot_move_is_refused():
    with pytest.raises(InvalidInputError) as caught:
        robots.from_mjcf(rubbing(damping=[1e11, *DAMPING[1:]], loss=[*LOSS[:5], 30.0]), "tip")
    assert str(caught.value) == (
        "joints 'pan', 'wrist3' have frictionloss 1.1, 30 N m and damping 1e+11, 1 N m s/rad, which torque limits of "
        "150, 28 N m do not move; lower them, servos hide such friction"
    )


@pytest.fixture(scope="module")
def moved():
    """Move the arm 5 cm to the side and back in 2 s, hold it, push it: what the controller says of contact."""
    model = rubbing()
    arm = robots.from_mjcf(model, "tip")
    at, data = arm.bind(model), mujoco.MjData(model)
    data.qpos[at.qpos] = arm.home
    mujoco.mj_forward(model, data)
    controller, start = cs.Controller(arm, cs.presets.safe()), arm.tool_pose(arm.home)
    controller.reset(arm.home)
    contact, error = np.zeros(4000, dtype=bool), np.zeros(4000)
    for k in range(4000):
        away = 0.025 * (1.0 - np.cos(np.pi * min(k, 2000) / 1000.0))
        pose = cs.Pose(start.position + np.array([0.0, away, 0.0]), start.quat)
        measured = cs.Measurement(data.qpos[at.qpos], data.qvel[at.dof], np.zeros(6))
        out = controller.step(measured, cs.Target(pose, stiffness=[150.0] * 3 + [450.0] * 3))
        data.ctrl[at.ctrl] = out.torque / at.gear
        data.body("forearm").xfrc_applied[:3] = (0.0, 30.0 * (k >= 3200), 0.0)
        mujoco.mj_step(model, data, at.steps)
        contact[k], error[k] = out.contact.in_contact, np.abs(out.error[:3]).max()
    return contact, error


def test_stiction_was_a_contact(moved):
    contact, _ = moved
    assert not contact[:3200].any()


def test_arm_with_frictionloss_ended_36_mm_off(moved):
    _, error = moved
    assert error[3199] < 0.006


def test_push_stronger_than_stiction_is_still_a_contact(moved):
    contact, _ = moved
    assert contact[3300:].all()
