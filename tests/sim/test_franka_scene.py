"""What stands about a simulated Franka is what the scene says."""

import math
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest

from contactsafe.robot import robots
from contactsafe.robot.franka import HAND, WIPER
from contactsafe.sim.fixtures import workbench
from contactsafe.sim.franka_meetings import GOES_S, bottle_in_the_way, pushes
from contactsafe.sim.franka_scene import TIP, FrankaScene, LinkPush, add_fixtures, add_obstacles, add_tip
from contactsafe.sim.obstacles import Obstacle


def model_of(build):
    root = ET.Element("mujoco")
    world = ET.SubElement(root, "worldbody")
    build(world)
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))


@pytest.mark.parametrize(("seconds", "fraction"), [(0.9, 0.0), (1.0, 0.0), (1.05, 0.5), (1.5, 1.0), (2.0, 0.0)])
def test_a_push_ramps_up_lasts_and_ends(seconds, fraction):
    push = LinkPush(5, (25.0, 0.0, 0.0), at_s=1.0, for_s=1.0, ramp_s=0.1)
    assert push.at(seconds) == pytest.approx(fraction)


def test_the_tips_lower_face_is_the_tool_point_and_it_weighs_what_the_tool_adds():
    def build(world):
        hand = ET.SubElement(world, "body", name="hand")
        add_tip(hand, FrankaScene(WIPER), HAND.inertia.mass)

    model = model_of(build)
    tip = model.geom(TIP)
    assert tip.pos[2] + tip.size[2] == pytest.approx(WIPER.tcp[2])
    assert model.body("hand").mass == pytest.approx(WIPER.inertia.mass - HAND.inertia.mass, rel=1e-3)


def test_a_tool_without_a_tip_adds_nothing():
    hand = ET.Element("body")
    add_tip(hand, FrankaScene(HAND), HAND.inertia.mass)
    assert len(hand) == 0


def test_the_workbench_stands_where_it_does_in_training():
    model = model_of(lambda world: add_fixtures(world, (workbench((0.5, 0.0, 0.01), (0.5, 0.6)),)))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    plate = model.geom("plate").id
    top = data.geom_xpos[plate][2] + model.geom_size[plate][2]
    assert top == pytest.approx(0.01)


def test_an_obstacle_on_springs_gives_way_by_force_over_stiffness():
    one = Obstacle((0.0, 0.0, 1.0), 0.03, 2000.0, mass=0.5)
    model = model_of(lambda world: add_obstacles(world, (one,)))
    data = mujoco.MjData(model)
    data.xfrc_applied[1, 0] = 20.0
    for _ in range(3000):
        mujoco.mj_step(model, data)
    assert data.qpos[0] == pytest.approx(0.01, rel=0.02)
    assert np.abs(data.qpos[1:]).max() < 1e-4  # it floats


def test_a_fixed_obstacle_has_no_joints():
    model = model_of(lambda world: add_obstacles(world, (Obstacle((0.0, 0.0, 1.0), 0.03, math.inf),)))
    assert model.nv == 0


def test_the_bottle_is_in_the_way_of_the_wrist_and_taken_aside():
    arm = robots.fr3()
    bottle, tool = bottle_in_the_way(arm), arm.tool_pose(arm.home).position
    assert bottle.position[0] > tool[0] + 0.1
    assert bottle.travel_s[0] == GOES_S
    assert math.hypot(*bottle.travel[:2]) > 0.3
    assert [push.link for push in pushes()] == [5, 5]
