"""MJCF and URDF are written from the same description, and say the same."""

import math
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.robot import robots
from contactsafe.robot.description import Capsule
from contactsafe.robot.mjcf import arm_mjcf, numbers
from contactsafe.robot.urdf import _capsule, arm_urdf


@pytest.fixture(scope="module")
def urdf(panda):
    return ET.fromstring(arm_urdf(panda.description, panda.tool))


def test_same_mass_of_every_body(arms):
    for arm in arms:
        urdf = ET.fromstring(arm_urdf(arm.description, arm.tool))
        masses = {
            link.get("name"): float(link.find("inertial/mass").get("value")) for link in urdf.iterfind("link[inertial]")
        }
        assert masses == {arm.model.body(i).name: arm.model.body_mass[i] for i in range(1, arm.model.nbody)}


def test_same_limits(panda, urdf):
    limits = [joint.find("limit") for joint in urdf.iterfind("joint[@type='revolute']")]
    for name, field in (("lower", "q_min"), ("upper", "q_max"), ("velocity", "qd_max"), ("effort", "tau_max")):
        assert_array_equal([float(limit.get(name)) for limit in limits], getattr(panda, field))
    assert_array_equal(panda.model.jnt_range.T, [panda.q_min, panda.q_max])
    assert_array_equal(panda.model.actuator_ctrlrange.T, [-panda.tau_max, panda.tau_max])


def test_same_tool_frame_at_home(panda):
    model = pinocchio.buildModelFromXML(arm_urdf(panda.description, panda.tool))
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, panda.home)
    frame = data.oMf[model.getFrameId("tcp")]
    ours = panda.dynamics(panda.home, np.zeros(7))
    assert_allclose(ours["position"], frame.translation, rtol=0, atol=1e-12)
    assert_allclose(ours["rotation"], frame.rotation, rtol=0, atol=1e-12)


def test_rotor_inertia_is_in_the_mjcf(panda):
    assert_array_equal(panda.model.dof_armature, panda.description.joint_array("armature"))


@pytest.mark.parametrize(("tool", "beyond_flange"), [(robots.HAND, 0.1034), (robots.WIPER, 0.130)])
def test_panda_at_home_stands_where_its_drawing_says(tool, beyond_flange):
    """Home leans the upper arm back by 45°, holds the forearm level and points the tool down."""
    s = math.sin(math.pi / 4)
    shoulder, upper, elbow, forearm, wrist, flange = 0.333, 0.316, 0.0825, 0.384, 0.088, 0.107
    elbow_x, elbow_z = s * (elbow - upper), shoulder + s * (elbow + upper)
    wrist_x, wrist_z = elbow_x + forearm, elbow_z + elbow
    pose = robots.panda(tool).tool_pose(robots.panda().home)
    assert_allclose(pose.position, [wrist_x + wrist, 0.0, wrist_z - flange - beyond_flange], rtol=0, atol=1e-12)
    assert_allclose(np.abs(pose.quat), [0.0, 1.0, 0.0, 0.0], rtol=0, atol=1e-12)


def test_numbers_read_back_to_the_same_floats():
    values = np.random.default_rng(5).normal(size=100) * 10.0 ** np.arange(-50, 50)
    assert_array_equal([float(word) for word in numbers(values).split()], values)


@pytest.mark.parametrize("end", [(0.1, 0.0, 0.0), (0.0, -0.2, 0.0), (0.0, 0.0, -0.3), (0.1, 0.2, 0.3), (0.0, 0.0, 0.0)])
def test_capsule_becomes_a_cylinder_between_two_spheres(end):
    link = ET.Element("link")
    _capsule(link, Capsule((0.0, 0.0, 0.0), end, 0.05))
    cylinder, first, second = link.iterfind("collision")
    origin = cylinder.find("origin")
    centre = np.array(origin.get("xyz").split(), dtype=float)
    axis = pinocchio.rpy.rpyToMatrix(np.array(origin.get("rpy").split(), dtype=float))[:, 2]
    half = float(cylinder.find("geometry/cylinder").get("length")) / 2
    assert_allclose(centre + half * axis, end, rtol=0, atol=1e-15)
    assert_allclose(centre - half * axis, 0.0, rtol=0, atol=1e-15)
    assert first.find("origin").get("xyz") == numbers((0.0, 0.0, 0.0))
    assert second.find("origin").get("xyz") == numbers(end)


def test_tip_is_the_same_box(panda, urdf):
    box = urdf.find("link[@name='tool']/collision/geometry/box")
    geom = panda.model.geom("tip")
    assert geom.type == mujoco.mjtGeom.mjGEOM_BOX
    assert_array_equal(np.array(box.get("size").split(), dtype=float), 2 * geom.size)


def test_tip_ends_at_the_tool_point(panda):
    geom, site = panda.model.geom("tip"), panda.model.site(panda.site)
    assert_allclose(geom.pos + geom.size * [0, 0, 1], site.pos, rtol=0, atol=1e-15)


def test_texts_do_not_change_from_call_to_call(panda):
    assert arm_urdf(panda.description, panda.tool) == arm_urdf(panda.description, panda.tool)
    assert arm_mjcf(panda.description, panda.tool) == arm_mjcf(panda.description, panda.tool)
