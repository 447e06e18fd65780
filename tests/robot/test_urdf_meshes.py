"""Meshes of a URDF, wherever its packages lie; and the URDF as a scene to simulate."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from contactsafe import robots
from contactsafe.core.errors import ModelWarning
from contactsafe.robot.spec_parts import remove

_LINK = """<link name="{0}"><inertial><mass value="2"/><inertia ixx=".02" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/>
</inertial><collision><geometry><mesh filename="{1}"/></geometry></collision></link>"""
_JOINT = """<joint name="j{0}" type="revolute"><parent link="l{0}"/><child link="l{1}"/><origin xyz="0 0 0.3"/>
<axis xyz="{2}"/><limit lower="-2" upper="2" effort="120" velocity="{1}"/>
<dynamics damping="0.5" friction="0.2"/></joint>"""
HOME = [0.0, 0.8, 0.3, -0.9, 0.4, 0.6]
AXES = ["0 0 1", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 1 0"]

pytestmark = pytest.mark.filterwarnings("error:arm:UserWarning")


def write(folder, mesh):
    """Write a URDF of six joints whose links all have one mesh, and the mesh into a package; return its path."""
    (folder / "arm_description" / "urdf").mkdir(parents=True)
    (folder / "arm_description" / "meshes").mkdir()
    (folder / "arm_description" / "meshes" / "part.obj").write_text(_TETRAHEDRON, encoding="utf-8")
    links = "".join(_LINK.format(f"l{i}", mesh) for i in range(7))
    joints = "".join(_JOINT.format(i, i + 1, axis) for i, axis in enumerate(AXES))
    path = folder / "arm_description" / "urdf" / "arm.urdf"
    path.write_text(f"<robot name='six'>{links}{joints}</robot>", encoding="utf-8")
    return path


_TETRAHEDRON = """v 0 0 0
v 0.05 0 0
v 0 0.05 0
v 0 0 0.2
f 1 3 2
f 1 2 4
f 2 3 4
f 3 1 4
"""


@pytest.mark.parametrize(
    "mesh",
    [
        "package://arm_description/meshes/part.obj",
        "package://arm_description/meshes/part.dae",
        "../meshes/part.obj",
    ],
    ids=["package", "another kind beside it", "relative"],
)
def test_none_of_nine_urdfs_loaded_for_their_mesh_paths(tmp_path, mesh):
    arm = robots.from_urdf(write(tmp_path, mesh), "l6", home=HOME)
    assert len(arm.surface) == 480
    assert_array_equal(arm.tau_max, 120.0)
    assert_array_equal(arm.qd_max, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    assert_array_equal(arm.friction_unknown[:, 1], 0.2)


def test_package_elsewhere_is_found_where_ros_says(tmp_path, monkeypatch):
    path = write(tmp_path / "here", "package://far/part.obj")
    (tmp_path / "ws" / "far").mkdir(parents=True)
    (tmp_path / "ws" / "far" / "part.obj").write_text(_TETRAHEDRON, encoding="utf-8")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ws"))
    assert len(robots.from_urdf(path, "l6", home=HOME).surface) == 480


def test_missing_meshes_are_left_out_with_one_note(tmp_path):
    path = write(tmp_path, "package://nowhere/part.dae")
    with pytest.warns(ModelWarning) as said:
        arm = robots.from_urdf(path, "l6", home=HOME)
    assert len(said) == 1
    assert str(said[0].message).startswith(
        "arm 'six': 7 collision meshes are left out: package://nowhere/part.dae; MuJoCo reads .stl, .obj, .msh"
    )
    assert len(arm.surface) == 0


def test_urdf_is_a_scene_that_its_arm_is_bound_to(tmp_path):
    path = write(tmp_path, "../meshes/part.obj")
    spec, _ = robots.urdf_spec(path, "l6")
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(1.0, 1.0, 0.1))
    arm, model = robots.from_urdf(path, "l6", home=HOME), spec.compile()
    at, data = arm.bind(model), mujoco.MjData(model)
    data.ctrl[at.ctrl] = 7.0 / at.gear
    mujoco.mj_forward(model, data)
    assert_array_equal(data.qfrc_actuator[at.dof], 7.0)
    assert data.ncon == 0


def test_effort_that_is_missing_is_taken_from_the_caller(tmp_path):
    path = write(tmp_path, "../meshes/part.obj")
    path.write_text(path.read_text(encoding="utf-8").replace('effort="120"', 'effort="0"'), encoding="utf-8")
    assert_array_equal(robots.from_urdf(path, "l6", tau_max=np.full(6, 110.0), home=HOME).tau_max, 110.0)


def test_links_that_overlap_at_their_joint_do_not_collide_the_root_link_neither(tmp_path):
    box = '<collision><geometry><box size="0.2 0.2 0.4"/></geometry></collision></link>'
    path = write(tmp_path, "../meshes/part.obj")
    text = path.read_text(encoding="utf-8")
    for name in ("l0", "l1"):
        head, _, rest = text.partition(f'<link name="{name}">')
        text = f'{head}<link name="{name}">' + rest.replace("</link>", box, 1)
    path.write_text(text, encoding="utf-8")
    spec, _ = robots.urdf_spec(path, "l6")
    contacts = []
    for _ in range(2):
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        contacts.append(data.ncon)
        for exclude in list(spec.excludes):
            remove(spec, exclude)
    assert contacts[0] == 0
    assert contacts[1] > 0  # they do overlap
