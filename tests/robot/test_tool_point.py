"""The arm in a file that nobody described is its longest chain of hinges, up to the hand."""

import re

import mujoco
import pytest
from tests.robot.test_models_as_they_come import SERVO

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.tool_point import find_tool


def found(xml):
    flange, joints = find_tool(mujoco.MjSpec.from_string(xml))
    return flange.body, joints


def with_in_hand(parts):
    return SERVO.replace('<geom type="box" size="0.02 0.02 0.02" pos="0.07 0 0" mass="0.3"/>',
                         f'<geom type="box" size="0.02 0.02 0.02" pos="0.07 0 0" mass="0.3"/>{parts}')  # fmt: skip


FINGER = '<body><joint name="{0}" type="{1}"/><geom size="0.01" mass="0.1"/></body>'


def test_hand_ends_a_plain_chain():
    assert found(SERVO) == ("hand", ["s1", "s2", "s3", "s4"])


@pytest.mark.parametrize("kind", ["slide", "hinge"])
def test_fingers_are_no_part_of_the_arm(kind):
    fingers = FINGER.format("left", kind) + FINGER.format("right", kind)
    assert found(with_in_hand(fingers)) == ("hand", ["s1", "s2", "s3", "s4"])


def test_slide_below_carries_the_arm_and_is_none_of_its_joints():
    lift = SERVO.replace('<body name="base">', '<body name="base"><joint name="lift" type="slide" axis="0 0 1"/>')
    assert found(lift) == ("hand", ["s1", "s2", "s3", "s4"])


def test_head_beside_the_arm_is_not_taken():
    head = '<body><joint name="pan"/><geom size="0.05" mass="1"/></body>'
    assert found(SERVO.replace("<worldbody>", f"<worldbody>{head}")) == ("hand", ["s1", "s2", "s3", "s4"])


def test_model_without_an_arm_is_refused():
    xml = "<mujoco><worldbody><body><joint/><geom size='0.1'/></body></worldbody></mujoco>"
    with pytest.raises(
        InvalidInputError, match=r"the model has a chain of 1 hinges; an arm has two at least: name its tool"
    ):
        find_tool(mujoco.MjSpec.from_string(xml))


def test_hand_of_three_long_fingers_is_no_part_of_the_arm():
    """The finger first in the file became the arm's end."""
    finger = "".join(f'<body pos="0 0 0.02"><joint name="{{0}}{i}"/><geom size="0.01" mass="0.1"/>' for i in range(3))
    fingers = "".join(finger.format(name) + 3 * "</body>" for name in ("index", "middle", "thumb"))
    assert found(with_in_hand(fingers)) == ("hand", ["s1", "s2", "s3", "s4"])


def test_torso_with_two_arms_and_a_head_is_followed_into_an_arm():
    """Two arms of four joints and a neck of two, on a torso of one: no hand yet."""
    body = SERVO.partition("<worldbody>")[2].partition("</worldbody>")[0]
    arms = "".join(re.sub(r'(name=")', rf"\g<1>{side}_", body) for side in ("left", "right"))
    tilt = '<body><joint name="tilt"/><geom size="0.05" mass="1"/></body>'
    neck = f'<body><joint name="pan"/><geom size="0.05" mass="1"/>{tilt}</body>'
    torso = f'<body><joint name="waist"/><geom size="0.1" mass="5"/>{neck}{arms}</body>'
    start, _, rest = SERVO.partition(body)
    model = start + torso + rest[: rest.index("<actuator>")] + "</mujoco>"
    assert found(model) == ("left_hand", ["waist", "left_s1", "left_s2", "left_s3", "left_s4"])
