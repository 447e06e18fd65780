"""An arm read from a URDF is the one that the URDF was written from."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe import robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.regressor import motion_of, nominal_terms
from contactsafe.robot.urdf import arm_urdf


@pytest.fixture(scope="module")
def panda():
    return robots.panda("hand")


@pytest.fixture
def file(panda, tmp_path):
    text = arm_urdf(panda.description, panda.tool)
    seen = '<visual><geometry><mesh filename="package://none/link.dae"/></geometry></visual>'
    path = tmp_path / "panda.urdf"
    path.write_text(text.replace('<link name="link3">', f'<link name="link3">{seen}'), encoding="utf-8")
    return path


def test_it_is_the_arm_it_was_written_from(panda, file):
    read = robots.from_urdf(file, "tcp", home=panda.home)
    assert_allclose(read.tau_max, panda.tau_max)
    assert_allclose(read.qd_max, panda.qd_max)
    assert_allclose(read.q_min, panda.q_min)
    assert_allclose(read.tool_pose(panda.home).position, panda.tool_pose(panda.home).position, atol=1e-9)
    q, qd = panda.home[None], np.ones((1, 7))
    ours, theirs = (nominal_terms(arm, motion_of(arm, q, qd), qd, rotors=False) for arm in (panda, read))
    assert_allclose(ours[0], theirs[0], atol=1e-6)
    assert_allclose(ours[1], theirs[1], atol=1e-6)
    assert not read.model.dof_armature.any()


@pytest.mark.parametrize(
    "beside",
    [
        '<transmission name="t"><joint name="joint1"><hardwareInterface>E</hardwareInterface></joint></transmission>',
        '<ros2_control name="c" type="system"><joint name="joint1"><command_interface name="effort"/></joint>'
        "</ros2_control>",
    ],
)
def test_a_transmission_takes_no_speed_limit_away(panda, file, beside):
    """Its <joint> has no <limit>, and is none of the robot's joints."""
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("</robot>", f"{beside}</robot>"), encoding="utf-8")
    read = robots.from_urdf(file, "tcp", home=panda.home)
    assert_allclose(read.qd_max, panda.qd_max)
    assert_allclose(read.tau_max, panda.tau_max)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("<robot", "is no URDF that can be read"),
        ("<mujoco/>", "has no <robot>; give a URDF"),
        ('<robot name="a"><link name="b"/></robot>', "has no link 'tcp'; give one of b"),
    ],
)
def test_what_is_no_urdf_is_told_in_one_line(tmp_path, content, text):
    (tmp_path / "arm.urdf").write_text(content, encoding="utf-8")
    with pytest.raises(InvalidInputError, match=text) as caught:
        robots.from_urdf(tmp_path / "arm.urdf", "tcp")
    assert "\n" not in str(caught.value)


def test_a_call_without_a_link_is_told_those_that_there_are(tmp_path):
    (tmp_path / "arm.urdf").write_text('<robot name="a"><link name="b"/><link name="c"/></robot>', encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"^link = None; give one of b, c$"):
        robots.from_urdf(tmp_path / "arm.urdf")


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InvalidInputError, match="is no URDF that can be read"):
        robots.from_urdf(tmp_path / "none.urdf", "tcp")


def test_a_joint_without_effort_needs_a_torque_limit(file):
    file.write_text(file.read_text(encoding="utf-8").replace('effort="87.0"', 'effort="0"'), encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"joints 'joint1', .* have no torque limit; give tau_max=\[...\], 7"):
        robots.from_urdf(file, "tcp")
