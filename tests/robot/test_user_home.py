"""Where nobody gave a home, the arm starts where it can work: not stretched out, and carried by its motors."""

import mujoco
import numpy as np
import pytest

from contactsafe import robots
from contactsafe.robot.ik import solve_ik
from contactsafe.robot.user_home import least_reach

pytestmark = pytest.mark.filterwarnings("ignore:arm:UserWarning")

AXES = ("0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
"""Of an arm whose middle of the range is stretched out, as many downloaded ones of seven joints have it."""


def column(axes, spread=2.5, force=200.0, mass=2.0):
    """Write an arm of links of 25 cm, one above the other, without a key frame; as an `MjSpec`."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    body = spec.worldbody
    for i, axis in enumerate(axes):
        body = body.add_body(name=f"link{i}", pos=[0.0, 0.0, 0.25 if i else 0.1])
        joint = body.add_joint(name=f"j{i}", axis=[float(x) for x in axis.split()], range=[-spread, spread])
        joint.limited, joint.armature = mujoco.mjtLimited.mjLIMITED_TRUE, 0.1
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[0, 0, 0.06, 0, 0, 0.19], size=[0.03, 0, 0], mass=mass)
        motor = spec.add_actuator(name=f"m{i}", target=f"j{i}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()
        motor.forcelimited, motor.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, [-force, force]
    body.add_site(name="tool", pos=[0.0, 0.0, 0.2])
    return spec


def reach(arm, q):
    data = mujoco.MjData(arm.model)
    data.qpos[:] = q
    mujoco.mj_fwdPosition(arm.model, data)
    return least_reach(arm.model, data)


def test_arm_that_the_middle_of_its_range_stretches_out_can_move_its_tool_from_home():
    """Stretched out it reached nothing: no direction of 10 cm had a posture."""
    arm = robots.from_mjcf(column(AXES), "tool", actuators="torque")
    middle = 0.5 * (arm.q_min + arm.q_max)
    assert reach(arm, middle) < 0.01
    assert reach(arm, arm.home) > 0.03
    pose, nominal, q = arm.tool_pose(arm.home), arm.nominal(), np.empty(arm.n)
    reached = [
        solve_ik(nominal.handle, pose.position + move, pose.quat, arm.home.copy(), arm.q_min, arm.q_max, q)[0] < 1e-3
        for move in 0.1 * np.concatenate([np.eye(3), -np.eye(3)])
    ]
    assert sum(reached) >= 3


@pytest.mark.parametrize("turned", [0.0, np.pi])
def test_home_reached_into_the_table_that_the_arm_stands_on(turned):
    """A shoulder whose range lies all to one side had the elbow below the base; hung from a ceiling it is the same."""
    spec = column(("0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1", "0 1 0"))
    shoulder = spec.joint("j1")
    shoulder.range = [0.6, 4.6]
    spec.body("link0").quat = [np.cos(0.5 * turned), np.sin(0.5 * turned), 0.0, 0.0]
    if turned:
        spec.body("link0").pos = [0.0, 0.0, -0.1]
    arm = robots.from_mjcf(spec, "tool", actuators="torque")
    data = mujoco.MjData(arm.model)
    data.qpos[:] = arm.home
    mujoco.mj_kinematics(arm.model, data)
    up = 1.0 if turned == 0.0 else -1.0
    heights = up * (np.vstack([data.xanchor, data.site_xpos[:1]]) - data.xanchor[0])[:, 2]
    assert heights.min() > -0.1


def test_home_is_within_the_range_and_carried_by_the_motors():
    arm = robots.from_mjcf(column(AXES, force=60.0), "tool", actuators="torque")
    data = mujoco.MjData(arm.model)
    data.qpos[:] = arm.home
    mujoco.mj_forward(arm.model, data)
    assert (np.abs(data.qfrc_bias) <= 0.5 * arm.tau_max).all()
    assert (arm.home > arm.q_min).all()
    assert (arm.home < arm.q_max).all()


def test_home_is_the_same_every_time():
    one, other = (robots.from_mjcf(column(AXES), "tool", actuators="torque") for _ in range(2))
    np.testing.assert_array_equal(one.home, other.home)


def test_arm_of_parallel_axes_that_never_moves_its_tool_to_all_sides_starts_in_the_middle():
    """What it moves by rounding alone differs from machine to machine, and chooses nothing."""
    arm = robots.from_mjcf(column(4 * ("0 1 0",)), "tool", actuators="torque")
    np.testing.assert_array_equal(arm.home, np.zeros(4))


def test_home_that_was_given_is_taken_as_it_is():
    given = np.full(7, 0.3)
    np.testing.assert_array_equal(robots.from_mjcf(column(AXES), "tool", actuators="torque", home=given).home, given)
