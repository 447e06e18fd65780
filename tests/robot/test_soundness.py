"""Gravity, ranges and models that hold numbers which are none: refused in one line, or served."""

import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from tests.robot.worlds import ELBOW

from contactsafe import Controller, Measurement, Target, presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot import robots


def elbow(*replacements):
    xml = ELBOW
    for old, new in zip(replacements[::2], replacements[1::2], strict=True):
        assert old in xml
        xml = xml.replace(old, new)
    return robots.from_mjcf(mujoco.MjModel.from_xml_string(xml), site="tip")


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (
            "<worldbody>",
            '<option gravity="nan 0 0"/><worldbody>',
            "gravity = (nan, 0, 0) m/s²; give finite numbers below 1000 in the model's option",
        ),
        (
            "<worldbody>",
            '<option gravity="0 0 -1e30"/><worldbody>',
            "gravity = (0, 0, -1e+30) m/s²; give finite numbers below 1000 in the model's option",
        ),
        (
            'range="-2 2"',
            'limited="true" range="nan nan"',
            "joint 'a' has the range [nan, nan] rad; give a lower end below the upper one, or no range",
        ),
        (
            'range="-2 2"',
            'limited="true" range="-1 nan"',
            "joint 'a' has the range [-1, nan] rad; give a lower end below the upper one, or no range",
        ),
    ],
)
def test_numbers_that_are_none_gave_a_torque_that_was_none(old, new, text):
    """Or joint stops that were off."""
    with pytest.raises(InvalidInputError) as caught:
        elbow(old, new)
    assert str(caught.value) == text


def test_weightless_arm_is_one():
    assert not elbow("<worldbody>", '<option gravity="0 0 0"/><worldbody>').model.opt.gravity.any()


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("tau_max", np.nan, "tau_max[0] = nan N m is no limit; give a number greater than 0"),
        ("qd_max", 0.0, "qd_max[0] = 0 rad/s is no limit; give a number greater than 0"),
        (
            "q_min",
            4.0,
            "joint 'joint1' has the range [4, 2.8973] rad; give a lower end below the upper one, or no range",
        ),
    ],
)
def test_limits_that_are_none_are_refused(panda, field, value, text):
    limits = getattr(panda, field).copy()
    limits[0] = value
    with pytest.raises(InvalidInputError) as caught:
        replace(panda, **{field: limits})
    assert str(caught.value) == text


def test_masses_that_are_none_are_refused(panda):
    model = copy.copy(panda.model)
    model.body_mass[1] = np.nan
    with pytest.raises(InvalidInputError, match="body_mass of arm 'panda' has a number that is not finite; mend"):
        replace(panda, model=model)


@pytest.mark.parametrize("width", [0.3, 0.01])
def test_range_narrower_than_two_joint_margins_was_42_nm_at_rest_in_its_middle(width):
    """Where the two stops overlapped, the lower one pushed; half of such a range is now free of both."""
    arm = elbow('range="-2 2"', f'range="{0.3 - width / 2} {0.3 + width / 2}"')
    controller = Controller(arm, presets.safe())
    for where in (-0.24, 0.0, 0.24):
        q = np.array([0.3 + where * width, 0.0])
        controller.reset(q)
        target = Target(arm.tool_pose(q), np.full(6, 150.0), posture=q)
        torque = controller.step(Measurement(q, np.zeros(2)), target).torque
        assert np.abs(torque - arm.dynamics(q, np.zeros(2))["g"]).max() < 1e-6
    q = np.array([0.3 + 0.4 * width, 0.0])
    controller.reset(q)
    torque = controller.step(Measurement(q, np.zeros(2)), Target(arm.tool_pose(q), np.full(6, 150.0), posture=q)).torque
    assert torque[0] < arm.dynamics(q, np.zeros(2))["g"][0]


@pytest.mark.parametrize("rate", [np.nan, 0.0, -1.0, 1e-320, np.inf, 1e300])
def test_torque_rates_that_are_none_gave_a_torque_that_was_none_for_ever(panda, rate):
    with pytest.raises(InvalidInputError) as caught:
        replace(panda, torque_rate_max=rate)
    assert str(caught.value) == (
        f"torque_rate_max = {rate:g} N m/s; give a number from 1e-06 to 1e+12: 1e9 allows any torque at once"
    )


@pytest.mark.parametrize("rate", [1e-6, 1e9, 1e12])
def test_the_slowest_and_the_fastest_torque_there_is_are_numbers(panda, rate):
    arm = replace(panda, torque_rate_max=rate)
    controller = Controller(arm, presets.safe())
    controller.reset(arm.home)
    target = Target(arm.tool_pose(arm.home), np.full(6, 150.0), posture=arm.home + 0.1)
    for speed in (0.0, 0.1, 0.0):
        torque = controller.step(Measurement(arm.home, np.full(7, speed)), target).torque
        assert (np.abs(torque) <= arm.tau_max).all()


@pytest.mark.parametrize(
    ("column", "value", "text"),
    [
        (0, np.nan, "friction[1, 0] = nan N m; give φ1 from 0 to 174, twice tau_max[1]"),
        (0, -0.5, "friction[1, 0] = -0.5 N m; give φ1 from 0 to 174, twice tau_max[1]"),
        (0, 1e308, "friction[1, 0] = 1e+308 N m; give φ1 from 0 to 174, twice tau_max[1]"),
        (1, -1.0, "friction[1, 1] = -1 s/rad; give a finite φ2 from 0 on"),
        (1, np.inf, "friction[1, 1] = inf s/rad; give a finite φ2 from 0 on"),
        (2, np.nan, "friction[1, 2] = nan rad/s; give a finite φ3"),
    ],
)
def test_friction_that_is_none_or_drives_its_joint_is_refused(panda, column, value, text):
    friction = panda.friction.copy()
    friction[1, column] = value
    with pytest.raises(InvalidInputError) as caught:
        replace(panda, friction=friction)
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("tau_max", np.zeros(6), "tau_max has shape (6,); give 7 numbers"),
        ("tau_max", 87.0, "tau_max has shape (); give 7 numbers"),
        ("tau_max", np.full(7, np.inf), "tau_max[0] = inf N m is no limit; give what the motor can do"),
        ("q_min", np.zeros((7, 1)), "q_min has shape (7, 1); give 7 numbers"),
        ("friction", np.zeros((3, 7)), "friction has shape (3, 7); give 7 × 3 numbers"),
        ("friction", None, "friction has shape (); give 7 × 3 numbers"),
        ("home", [0.0] * 8, "home has shape (8,); give 7 numbers"),
        ("home", [np.nan] * 7, "home[0] = nan rad; give a posture well inside the limits"),
        ("torque_rate_max", "fast", "torque_rate_max is str, not numbers; give one number"),
        ("torque_rate_max", np.full(7, 1e3), "torque_rate_max has shape (7,); give one number"),
        ("lever_doubted", np.nan, "lever_doubted = nan m; give a finite number from 0 on"),
        ("surface", [[0.0] * 6], "surface has shape (1, 6); give 1 × 7 numbers"),
        ("surface", [[np.inf] * 7], "surface of arm 'panda' has a number that is not finite; give finite points"),
    ],
)
def test_arms_of_another_number_of_joints_or_of_no_numbers_are_refused(panda, field, value, text):
    with pytest.raises(InvalidInputError) as caught:
        replace(panda, **{field: value})
    assert str(caught.value) == text


def test_lists_serve_as_arrays(panda):
    arm = replace(panda, tau_max=panda.tau_max.tolist(), friction=panda.friction.tolist(), torque_rate_max=1000)
    assert (arm.tau_max == panda.tau_max).all()
    Controller(arm, presets.safe()).reset(arm.home)


@pytest.mark.parametrize("field", ["body_mass", "body_inertia", "dof_armature"])
def test_negative_masses_are_refused(panda, field):
    model = copy.copy(panda.model)
    getattr(model, field)[-1] = -1.0
    with pytest.raises(InvalidInputError, match=f"^{field} of arm 'panda' has a negative number; mend the model$"):
        replace(panda, model=model)


@pytest.mark.parametrize(
    ("field", "index", "value", "text"),
    [
        ("drag", (1, 0), -1.0, "drag[1, 0] = -1 N m s/rad; give viscous friction from 0 on"),
        ("drag", (1, 1), np.nan, "drag[1, 1] = nan N m; give a constant torque within ±87"),
        ("sensor_drag", (5, 1), 13.0, "sensor_drag[5, 1] = 13 N m; give a constant torque within ±12"),
        ("drag", (0, 2), 88.0, "drag[0, 2] = 88 N m; give dry friction from 0 to 87"),
        (
            "sensor_friction",
            (2, 0),
            -175.0,
            "sensor_friction[2, 0] = -175 N m; give φ1 from -174 to 174, twice tau_max[2]",
        ),
        ("sensor_drag", (2, 2), -88.0, "sensor_drag[2, 2] = -88 N m; give dry friction from -87 to 87"),
        ("sensor_drag", (2, 0), np.inf, "sensor_drag[2, 0] = inf N m s/rad; give a finite number"),
        ("drag", (0, 2), -0.1, "drag[0, 2] = -0.1 N m; give dry friction from 0 to 87"),
    ],
)
def test_drag_that_is_none_or_drives_its_joint_is_refused(panda, field, index, value, text):
    values = getattr(panda, field).copy()
    values[index] = value
    with pytest.raises(InvalidInputError) as caught:
        replace(panda, **{field: values})
    assert str(caught.value) == text
