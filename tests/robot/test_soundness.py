"""Gravity, ranges and models that hold numbers which are none: refused in one line, or served."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from tests.robot.worlds import ELBOW

from contactsafe import Controller, Measurement, Target, presets
from contactsafe.errors import InvalidInputError
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
    model = mujoco.MjModel.from_xml_string(ELBOW)
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
