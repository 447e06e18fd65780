"""Models of files in a scene: found, locked but for the arm, with a sphere that is fixed or on springs."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from contactsafe import robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.urdf import arm_urdf
from contactsafe.sim.model_arms import load_model, pushed_at
from contactsafe.sim.model_scenes import SPHERE_M, build_scene

FILE = Path(__file__).parents[2] / "examples" / "servo_arm.xml"


@pytest.fixture(scope="module")
def of():
    return load_model(str(FILE))


def with_parts(tmp_path, *replacements):
    """Write the example's arm with other parts, as files of other people have them."""
    xml = FILE.read_text(encoding="utf-8")
    for old, new in replacements:
        assert old in xml
        xml = xml.replace(old, new, 1)
    path = tmp_path / "other.xml"
    path.write_text(xml, encoding="utf-8")
    return str(path)


def test_arm_is_named_by_its_folder_and_file(of):
    assert of.name == "examples/servo_arm"
    assert of.arm.n == 6


def test_tool_may_be_a_body_of_the_file():
    assert load_model(f"{FILE}:wrist3").name == "examples/servo_arm:wrist3"


def test_an_arm_on_a_lift_was_refused_though_the_tool_was_named(tmp_path):
    """The joints that fit were told, in words of Python, to somebody at a command line."""
    spec = mujoco.MjSpec.from_file(str(FILE))
    lifted = mujoco.MjSpec()
    lifted.option.timestep = spec.option.timestep
    mast = lifted.worldbody.add_body(name="mast")
    mast.add_joint(name="mast_z", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1], range=[0, 0.3])
    mast.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.05, 0.05, 0.01], mass=5.0)
    spec.option.cone, spec.option.jacobian = lifted.option.cone, lifted.option.jacobian
    spec.delete(spec.geom("floor"))
    lifted.attach(spec, prefix="its_", frame=mast.add_frame())
    path = tmp_path / "lifted.xml"
    lifted.compile()
    path.write_text(lifted.to_xml(), encoding="utf-8")
    of = load_model(f"{path}:its_wrist3")
    assert of.arm.n == load_model(str(FILE)).arm.n
    assert "mast_z" in of.others


def test_tool_that_is_nowhere_is_refused_with_those_that_are():
    with pytest.raises(
        InvalidInputError, match=r"body 'hook' of the flange is not in the model; give one of: .*wrist3"
    ):
        load_model(f"{FILE}:hook")


def test_urdf_is_loaded_by_its_link(tmp_path):
    panda = robots.panda("hand")
    path = tmp_path / "panda.urdf"
    path.write_text(arm_urdf(panda.description, panda.tool), encoding="utf-8")
    assert load_model(f"{path}:tcp").arm.n == 7
    with pytest.raises(InvalidInputError, match=r"names no link of the tool; write .*panda\.urdf:LINK"):
        load_model(str(path))


def test_file_that_mujoco_cannot_read_is_refused_by_name(tmp_path):
    broken = tmp_path / "broken.xml"
    broken.write_text("<mujoco><worldbody><geom/></mujoco>", encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"MuJoCo cannot read '.*broken\.xml': .*; mend the file"):
        load_model(str(broken))


def test_joints_that_are_not_the_arms_stay_where_they_are(tmp_path):
    shape = '<geom type="sphere" size="0.1" mass="5" contype="0" conaffinity="0"/>'
    slide = f'<body name="cart"><joint name="cart" type="slide" axis="0 0 1"/>{shape}</body>'
    path = with_parts(tmp_path, ("<worldbody>", f"<worldbody>{slide}"), ("<keyframe>", "<!--"), ("</keyframe>", "-->"))
    of = load_model(path)
    scene = build_scene(of)
    for _ in range(500):
        scene.step(np.zeros(of.arm.n))
    assert abs(scene.data.joint("cart").qpos[0]) < 1e-3
    assert np.abs(scene.q - of.arm.home).max() > 0.1  # the arm does fall


def test_other_joints_begin_where_the_arms_model_has_them(tmp_path):
    """The key frame of home lifts the arm; its scene began with the lift down, and the tool elsewhere."""
    lift = '<body name="pedestal" pos="0 0 0.4"><joint name="cart" type="slide" axis="0 0 1"/>'
    of = load_model(
        with_parts(tmp_path, ('<body name="pedestal" pos="0 0 0.4">', lift), ('qpos="0 -0.2', 'qpos="0.2 0 -0.2'))
    )
    scene = build_scene(of)
    assert scene.data.joint("cart").qpos[0] == pytest.approx(0.2)
    np.testing.assert_allclose(scene.tool, of.arm.tool_pose(of.arm.home).position, atol=1e-9)


def test_scene_begins_at_home_at_rest(of):
    scene = build_scene(of)
    np.testing.assert_array_equal(scene.q, of.arm.home)
    np.testing.assert_array_equal(scene.qd, np.zeros(of.arm.n))


@pytest.mark.parametrize(("stiffness", "moves"), [(np.inf, False), (2000.0, True)])
def test_sphere_gives_way_only_on_springs(of, stiffness, moves):
    tool = of.arm.tool_pose(of.arm.home).position
    scene = build_scene(of, tool - np.array([0.0, 0.0, SPHERE_M + 0.03]), stiffness)
    before = scene.data.body("met").xpos.copy()
    for _ in range(300):
        scene.step(np.zeros(of.arm.n))  # the arm falls on it
    assert (np.linalg.norm(scene.data.body("met").xpos - before) > 1e-4) == moves


def test_file_whose_joints_are_limited_by_default_takes_a_sphere_on_springs(tmp_path):
    """The sphere's joints are the file's default as well, and had no range."""
    path = with_parts(tmp_path, ('<joint axis="0 1 0" range="-6.28 6.28"', '<joint axis="0 1 0" limited="true"'))
    text = Path(path).read_text(encoding="utf-8")
    Path(path).write_text(re.sub(r'(<joint name="\w+")(?! range)', r'\1 range="-3 3"', text), encoding="utf-8")
    scene = build_scene(load_model(path), np.array([2.0, 2.0, 2.0]), 1000.0)
    scene.step(np.zeros(6))
    assert np.isfinite(scene.q).all()


def test_push_is_amid_the_arm_and_level(of):
    joint, force = pushed_at(of)
    names = [of.arm.model.joint(i).name for i in range(of.arm.n)]
    assert 1 < names.index(joint) < of.arm.n - 1
    assert force[2] == 0.0
