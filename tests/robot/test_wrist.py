"""The wrist sensors of a user's scene read what touches the tool, and nothing while it touches nothing."""

import re

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.robot.worlds import SIX

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot import robots
from contactsafe.robot.robots import WristNames

HAND = """
<body name="hand" pos="0 0.05 0">
  <site name="ft" euler="0.3 0.2 -1"/>
  <geom name="pad" type="box" size="0.03 0.02 0.03" pos="0 0.03 0" mass="0.6"/>
  <body name="finger" pos="0.02 0.04 0"><geom type="sphere" size="0.005" mass="0.2"/>
    <site name="com" pos="-0.015 -0.0075 0"/>
  </body>
  <site name="tip" pos="0 0.05 0" euler="-1.5708 0 0"/>
</body>
"""
FORCE, TORQUE = '<force name="f" site="ft"/>', '<torque name="t" site="ft"/>'
ACCELEROMETER = '<accelerometer name="a" site="com"/>'


def scene(*sensors):
    """Compile the six-joint arm with a hand that sensors carry, and a plate that floats at a mocap body's place."""
    hand = SIX.replace('<site name="tip" pos="0 0.1 0" euler="-1.5708 0 0"/>', HAND)
    plate = '<body name="plate" mocap="true" pos="0 0 -5"><geom name="plate" type="box" size="0.1 0.1 0.02"/></body>'
    hand = hand.replace("<worldbody>", "<worldbody>" + plate)
    return mujoco.MjModel.from_xml_string(
        re.sub("<sensor>.*</sensor>", f"<sensor>{''.join(sensors)}</sensor>", hand, flags=re.DOTALL)
    )


def bound(model, **options):
    arm = robots.from_mjcf(model, site="tip")
    return arm, arm.bind(model, **options)


def contact_wrench(model, data, point):
    """Sum what the plate exerts on the pad about a point by the public API, world axes, (6,)."""
    wrench, force = np.zeros(6), np.zeros(6)
    for i, contact in enumerate(data.contact[: data.ncon]):
        mujoco.mj_contactForce(model, data, i, force)
        sign = 1.0 if contact.geom[1] == model.geom("pad").id else -1.0
        F, T = (sign * contact.frame.reshape(3, 3).T @ part for part in (force[:3], force[3:]))
        wrench += np.concatenate([F, T + np.cross(contact.pos - point, F)])
    return wrench


def hold(model, data, arm, at, ticks, target):
    """Hold the arm by springs at its joints and its weight; yield the wrench read at every tick."""
    for tick in range(ticks):
        q, qd = data.qpos[at.qpos], data.qvel[at.dof]
        torque = 2000.0 * (target(tick) - q) - 200.0 * qd + arm.dynamics(q, qd)["g"]
        data.ctrl[at.ctrl] = np.clip(torque, -arm.tau_max, arm.tau_max) / at.gear
        mujoco.mj_step(model, data, at.steps)
        yield at.wrench(data)


def start(model, arm):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("sensors", [(FORCE, TORQUE, ACCELEROMETER), (FORCE, TORQUE)], ids=["accelerometer", "bare"])
def test_a_press_on_a_plate_is_read_as_it_is(sensors):
    model = scene(*sensors)
    arm, at = bound(model)
    data = start(model, arm)
    beneath = np.array([0.02, 0.01, -0.0205])  # the pad, which the plate then comes up to
    data.mocap_pos[0] = arm.tool_pose(arm.home).position + beneath
    read = []
    for wrench in hold(model, data, arm, at, 1500, lambda _: arm.home):
        read.append(wrench)
        data.mocap_pos[0, 2] += 3e-6 if len(read) <= 1000 else 0.0
    seen = read[-1]
    true = contact_wrench(model, data, data.site("tip").xpos)
    assert true[2] > 5.0
    assert_allclose(seen[:3], true[:3], rtol=0, atol=0.02 * true[2])
    assert_allclose(seen[3:], true[3:], rtol=0, atol=0.02 * true[2] * 0.05)


def test_free_motion_reads_nothing():
    model = scene(FORCE, TORQUE, ACCELEROMETER)
    arm, at = bound(model)
    data = start(model, arm)
    wave = np.array([0.3, 0.2, -0.3, 0.3, 0.2, 0.5])
    read = hold(model, data, arm, at, 2000, lambda tick: arm.home + wave * np.sin(tick / 200) ** 2)
    forces = np.linalg.norm([wrench[:3] for wrench in read], axis=1)
    assert np.abs(data.qvel[at.dof]).max() > 0.1
    assert forces.max() < 0.5


def test_without_an_accelerometer_the_weight_alone_is_taken_out():
    model = scene(FORCE, TORQUE)
    arm, at = bound(model)
    data = start(model, arm)
    assert_allclose(list(hold(model, data, arm, at, 800, lambda _: arm.home))[-1], 0.0, atol=0.05)
    wave = np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0])
    moving = list(hold(model, data, arm, at, 300, lambda tick: arm.home + wave * np.sin(tick / 50) ** 2))
    assert np.abs(moving).max() > 1.0


def test_at_rest_whatever_the_posture_the_tool_weighs_nothing():
    model = scene(FORCE, TORQUE)
    arm, at = bound(model)
    data, rng = start(model, arm), np.random.default_rng(0)
    for _ in range(10):
        data.qpos[at.qpos] = rng.uniform(-2.0, 2.0, 6)
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
        data.qfrc_applied[at.dof] = 0.0
        data.ctrl[at.ctrl] = arm.dynamics(data.qpos[at.qpos], np.zeros(6))["g"] / at.gear
        mujoco.mj_forward(model, data)
        if data.ncon == 0:
            assert_allclose(at.wrench(data), 0.0, atol=1e-6)


SPARE = '<force name="spare" site="ft"/>'
MOVED = '<force name="elsewhere" site="tip"/>'
REFUSED = {
    "none": (
        (), None,
        "0 force sensors between the last joint and the tool (none), one is needed; add "
        '<force site="..."/>, or name one: arm.bind(model, wrist=WristNames(force="..."))',
    ),
    "several": (
        (FORCE, SPARE, TORQUE), None,
        "2 force sensors between the last joint and the tool ('f', 'spare'), one is needed; add "
        '<force site="..."/>, or name one: arm.bind(model, wrist=WristNames(force="..."))',
    ),
    "different sites": (
        (MOVED, TORQUE), None,
        "sensors 'elsewhere' and 't' are at different sites; give force and torque of one",
    ),
    "of another kind": (
        (FORCE, TORQUE), WristNames(force="t"), "sensor 't' measures no force; give the name of one that does",
    ),
    "unknown": ((FORCE, TORQUE), WristNames(torque="x"), "sensor 'x' is not in the model; give one of: f, t"),
    "not on the wrist": (
        ('<force name="base" site="box"/>', '<torque name="base_t" site="box"/>'), WristNames("base", "base_t"),
        "sensor 'base' is not on what joint 'wrist3' moves; give one that is",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_sensors_that_do_not_serve_are_refused_in_one_line(name):
    sensors, names, text = REFUSED[name]
    model = scene(*sensors)
    with pytest.raises(InvalidInputError) as caught:
        bound(model, wrist=names)[1].wrench(mujoco.MjData(model))
    assert str(caught.value) == text


def test_one_of_several_is_told_by_name():
    model = scene(FORCE, SPARE, TORQUE, ACCELEROMETER)
    arm, at = bound(model, wrist=WristNames(force="spare"))
    data = start(model, arm)
    assert_allclose(list(hold(model, data, arm, at, 500, lambda _: arm.home))[-1], 0.0, atol=0.05)
