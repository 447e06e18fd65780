"""The simulated Franka before anybody is connected, and what it says of its joints."""

import sys

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot import robots
from contactsafe.robot.franka import WIPER
from contactsafe.sim.fixtures import workbench
from contactsafe.sim.franka_scene import FrankaScene
from contactsafe.sim.franka_server import ADDRESSES, SimulatedFranka
from contactsafe.sim.obstacles import Obstacle

pytest.importorskip("franky_sim")

HOME = np.array(robots.fr3().home)


@pytest.fixture
def make():
    made = []

    def robot(**scene):
        made.append(SimulatedFranka(FrankaScene(WIPER, **scene), HOME))
        return made[-1]

    yield robot
    for one in made:
        one.close()


def test_it_stays_at_home_until_it_is_commanded(make):
    one = make()
    for _ in range(50):
        one.tick(lockstep=False)
    assert np.abs(one.data.qpos[one._q] - HOME).max() < 1e-3
    assert len(one.truth()) == 0
    assert not one.is_controlled


def test_each_robot_listens_at_an_address_of_its_own_on_this_machine_alone(make):
    addresses = [make().address for _ in range(2)]
    assert len(set(addresses)) == 2
    assert set(addresses) <= set(ADDRESSES)
    assert all(address.startswith("127.") for address in ADDRESSES)
    assert ADDRESSES[0] == "127.0.0.1"


def test_the_torque_behind_the_gears_is_what_holds_the_links_whatever_the_motors_do(make):
    """At rest it is gravity's: stiction takes whatever the motors do beyond that, before the sensor."""
    one = make(friction_left=1.0)
    for extra in (0.0, 0.2, -0.2):  # N m, less than stiction holds
        one._freeze()
        for _ in range(40):
            one._robot._torque_control(one.data.qfrc_bias[one._dof] + extra)
            one._sim._step()
            one._sense()
        assert np.abs(one._link_torque - one.data.qfrc_bias[one._dof]).max() < 0.02
        assert np.abs(one._drag + extra).max() < 0.02


@pytest.mark.parametrize("left", [1.0, 0.2])
def test_the_robots_own_loop_takes_off_all_but_a_part_of_its_friction(make, left):
    one = make(friction_left=left)
    one._drag[:] = np.linspace(-1.0, 1.0, 7)
    one._robot._torque_control(np.zeros(7))
    one._take_friction_off()
    np.testing.assert_allclose(one.data.qfrc_applied[one._dof], -(1.0 - left) * one._drag, atol=1e-12)


def test_forces_on_the_tip_are_told_from_those_on_the_arm(make):
    away = make(fixtures=(workbench(),), obstacles=(Obstacle((1.0, 0.5, 1.0), 0.05, 5000.0),))
    assert away._forces() == (0.0, 0.0)
    on_arm = make(obstacles=(Obstacle((0.3, 0.0, 0.75), 0.05, 5000.0),))
    assert on_arm._forces()[0] == 0.0
    assert on_arm._forces()[1] > 0.0
    tool = away.data.xpos[away._hand] + away.data.xmat[away._hand].reshape(3, 3) @ away._tcp
    on_tip = make(fixtures=(workbench((float(tool[0]), 0.0, float(tool[2]) + 0.002)),))
    assert on_tip._forces()[0] > 0.0
    assert on_tip._forces()[1] == 0.0


def test_the_tool_point_is_where_the_controllers_arm_has_it(make):
    one = make()
    tool = one.data.xpos[one._hand] + one.data.xmat[one._hand].reshape(3, 3) @ one._tcp
    assert np.allclose(tool, robots.fr3(WIPER).tool_pose(HOME).position, atol=2e-3)


def test_a_library_that_is_missing_is_told_with_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "franky_sim", None)
    with pytest.raises(InvalidInputError, match=r"contactsafe\[simulated\]"):
        SimulatedFranka(FrankaScene(WIPER), HOME)
