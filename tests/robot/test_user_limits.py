"""Torque limits as models have them, through filters, gears and several actuators."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.robot.worlds import TWO_JOINTS

from contactsafe import robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.binding import actuators_of
from contactsafe.robot.user_limits import rotor, torque_limit

MOTOR = '<motor joint="a" ctrlrange="-50 50"/>'


def with_motor(*motors):
    assert MOTOR in TWO_JOINTS
    return mujoco.MjModel.from_xml_string(TWO_JOINTS.replace(MOTOR, "".join(motors)))


@pytest.mark.parametrize(
    ("motors", "limit"),
    [
        (['<position joint="a" kp="100" ctrlrange="-2 2"/>'], np.inf),
        (['<position joint="a" kp="100" ctrlrange="-2 2" forcerange="-30 30"/>'], 30.0),
        (['<velocity joint="a" kv="100" ctrlrange="-2 2" forcerange="-30 40"/>'], 30.0),
        (['<motor joint="a" gear="-20" ctrlrange="-2 3"/>'], 40.0),
        (['<general joint="a" dyntype="filterexact" dynprm="0.01" gainprm="5" ctrlrange="-2 2"/>'], 10.0),
        (['<general joint="a" dyntype="integrator" gainprm="5" ctrlrange="-2 2"/>'], np.inf),
        (['<motor joint="a" ctrlrange="-5 5"/>', '<motor joint="a" ctrlrange="-9 9"/>'], 9.0),
        (['<motor joint="a" ctrlrange="-5 5"/>', '<position joint="a" kp="9"/>'], 5.0),
        (['<motor joint="a" ctrlrange="0 5"/>'], 0.0),
        ([], np.inf),
    ],
    ids=["servo", "servo with a force limit", "speed servo", "gear", "filter", "integrator", "two",
         "two, one unlimited", "one-sided", "none"],
)  # fmt: skip
def test_limit_of_a_joint(motors, limit):
    assert torque_limit(with_motor(*motors), 0) == limit


def test_joints_own_limit_holds_beside_the_motors():
    text = TWO_JOINTS.replace('name="a"', 'name="a" actuatorfrcrange="-20 25"')
    assert torque_limit(mujoco.MjModel.from_xml_string(text), 0) == 20.0


def test_rotors_of_actuators_count_through_their_gears():
    model = with_motor('<motor joint="a" gear="10" ctrlrange="-5 5"/>')
    if not hasattr(model, "actuator_armature"):
        pytest.skip("this MuJoCo has no armature of actuators")
    model.actuator_armature[actuators_of(model, 0)] = 1e-3
    assert_allclose(rotor(model, 0), 0.1 + 0.1)


@pytest.mark.parametrize("viscous", [0.0, 4.0])
def test_unknown_friction_that_is_none_is_refused(viscous):
    arm = robots.panda()
    wrong = np.zeros((7, 2))
    wrong[3] = viscous, -1.0
    with pytest.raises(InvalidInputError) as caught:
        replace(arm, friction_unknown=wrong)
    assert str(caught.value) == (
        f"friction_unknown[3] = ({viscous:g} N m s/rad, -1 N m); give finite numbers from 0 on"
    )


def test_panda_knows_all_of_its_friction():
    assert not robots.panda().friction_unknown.any()
