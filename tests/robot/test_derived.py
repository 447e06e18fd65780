"""A world's plant, built from the description of an arm in a user's scene, is the user's arm."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.robot.test_enclosing import standing_out
from tests.robot.test_user_mjcf import SCENES, TIGHT, bias, edited, samples
from tests.robot.worlds import ELBOW, MESH_JOINTS, MESHES, SIX

from contactsafe.robot import robots
from contactsafe.robot.bodies import base_bodies, link_of, shown_geoms
from contactsafe.robot.description import Tip
from contactsafe.robot.ik import trac_ik
from contactsafe.robot.mjcf import arm_mjcf
from contactsafe.robot.shape import arm_capsules
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.scene import build_plant


@pytest.fixture(scope="module", params=SCENES)
def scene(request):
    """The user's model, the arm found in it, and the plant of a world around that arm."""
    make, site, joints = SCENES[request.param]
    model = make()
    arm = robots.from_mjcf(model, site=site, joints=joints, tip=Tip((0.02, 0.02, 0.01)))
    return model, arm, build_plant(arm, WorldConfig())


def assert_same_arm(arm, plant, states):
    """Compare a plant with the nominal model: mass matrix, bias and tool pose to 1e-9."""
    n, data = arm.n, mujoco.MjData(plant)
    for q, qd in states:
        data.qpos[:n], data.qvel[:n] = q, qd
        mujoco.mj_forward(plant, data)
        M, ours = np.zeros((plant.nv, plant.nv)), arm.dynamics(q, qd)
        mujoco.mj_fullM(plant, data, M)
        assert_allclose(M[:n, :n], ours["M"], **TIGHT)
        assert_allclose(bias(plant, data, range(n)), ours["g"] + ours["c"], **TIGHT)
        assert_allclose(data.site("tcp").xpos, ours["position"], **TIGHT)
        assert_allclose(data.site("tcp").xmat.reshape(3, 3), ours["rotation"], **TIGHT)


def test_plant_moves_as_the_nominal_model(scene):
    _, arm, plant = scene
    assert_same_arm(arm, plant, samples(arm))


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_plants_of_random_arms_on_random_bases_move_as_their_nominal_models(random_arms, seed):
    rng = np.random.default_rng(seed)
    made = random_arms[seed % len(random_arms)]
    spec = mujoco.MjSpec.from_string(arm_mjcf(made.description, made.tool))
    quat = rng.normal(size=4)
    spec.body("link0").pos, spec.body("link0").quat = rng.normal(size=3), quat / np.linalg.norm(quat)
    spec.option.gravity = rng.normal(size=3) * 5
    arm = robots.from_mjcf(spec.compile(), site="tcp")
    assert_same_arm(arm, build_plant(arm, WorldConfig()), samples(arm, 5))


def test_masses_sum_and_limits_are_equal(scene):
    model, arm, plant = scene
    chain = [model.joint(arm.model.joint(i).name).id for i in range(arm.n)]
    moved = model.body_mass[link_of(model, chain) > 0].sum()
    base = model.body_mass[base_bodies(model, chain)].sum()
    parts = [link.inertia.mass for link in arm.description.links]
    assert_allclose(sum(parts) + arm.tool.inertia.mass, moved, rtol=0, atol=1e-9)
    assert_allclose(arm.description.base.mass, base, rtol=0, atol=1e-9)
    for name in ("q_min", "q_max", "qd_max", "tau_max", "friction"):
        assert_array_equal(arm.description.joint_array(name), getattr(arm, name))
    assert_array_equal(arm.description.joint_array("armature"), arm.model.dof_armature)
    assert_array_equal(arm.description.home, arm.home)
    limited = plant.jnt_limited[: arm.n].astype(bool)
    assert_array_equal(limited, np.isfinite(arm.q_min))
    assert_array_equal(plant.jnt_range[: arm.n][limited], np.column_stack([arm.q_min, arm.q_max])[limited])
    assert_array_equal(plant.opt.gravity, arm.model.opt.gravity)


@pytest.mark.parametrize("name", ["six", "elbow", "ball shoulder", "panda in a cell", "meshes"])
def test_capsules_hold_the_geoms_that_collide(name):
    """To 1e-6 m, at any posture: vertices of boxes and meshes, and the ends of what is round, grown by its radius."""
    make, site, joints = SCENES[name]
    model = make()
    arm = robots.from_mjcf(model, site=site, joints=joints)
    ids = [model.joint(arm.model.joint(i).name).id for i in range(arm.n)]
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    parts = link_of(model, ids)
    for q, _ in samples(arm, 5):
        data.qpos[model.jnt_qposadr[ids]] = q
        mujoco.mj_kinematics(model, data)
        starts, ends, radii, _ = arm_capsules(arm.description, arm.tool, q[None])
        capsules = list(zip(starts[0], ends[0], radii, strict=True))
        groups = [base_bodies(model, ids), *(parts == link for link in range(1, arm.n + 1))]
        for geom in np.concatenate([shown_geoms(model, group) for group in groups]):
            points = _points(model, data, geom)
            assert min(standing_out(_Placed(*capsule), points) for capsule in capsules) < 1e-6


class _Placed:
    def __init__(self, start, end, radius):
        self.start, self.end, self.radius = start, end, radius


def _points(model, data, geom):
    """Cast rays at a geom from all around: points of its surface, world, (k, 3), m."""
    rng, found = np.random.default_rng(3), []
    ray, centre, reach = np.zeros(1, np.int32), data.geom_xpos[geom], 2.0 * model.geom_rbound[geom] + 0.01
    for direction in rng.normal(size=(60, 3)):
        away = direction / np.linalg.norm(direction)
        start = centre + reach * away
        kind = model.geom_type[geom]
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            distance = mujoco.mj_rayMesh(model, data, geom, start, -away, np.zeros(3))
        else:
            pose = centre, data.geom_xmat[geom]
            distance = mujoco.mju_rayGeom(*pose, model.geom_size[geom], start, -away, kind, np.zeros(3))
        if distance >= 0.0:
            found.append(start - distance * away)
    assert len(found) > 20, ray
    return np.array(found)


def test_what_the_last_link_carries_is_the_tool():
    arm = robots.from_mjcf(mujoco.MjModel.from_xml_string(MESHES), site="tip", joints=MESH_JOINTS)
    assert len(arm.description.links[-1].capsules) == 1
    assert len(arm.tool.capsules) == 2  # gripper and jaw
    assert [len(link.capsules) for link in arm.description.links[:3]] == [1, 1, 1]  # what does not collide is not there
    assert len(arm.description.base_capsules) == 3
    assert arm.tool.tip is None


def test_nothing_but_the_tip_reaches_the_tips_face():
    """The user's own pad is the tip; a gripper around it is moved back."""
    pad = '<geom type="box" size="0.04 0.03 0.01" pos="0 0 0.11"/><site name="pad" pos="0 0 0.12"/><site name="tip"'
    model = edited(MESHES, '<site name="tip"', pad)
    tip = Tip((0.04, 0.03, 0.01))
    shapes = robots.from_mjcf(model, site="pad", joints=MESH_JOINTS, tip=tip).tool.capsules
    assert len(shapes) == 2
    assert max(max(c.start[2], c.end[2]) + c.radius for c in shapes) <= -0.02 + 1e-5
    assert len(robots.from_mjcf(model, site="pad", joints=MESH_JOINTS).tool.capsules) == 3


def test_tip_changes_nothing_that_a_controller_reads():
    model = mujoco.MjModel.from_xml_string(SIX)
    plain, tipped = (robots.from_mjcf(model, site="tip", tip=tip) for tip in (None, Tip((0.02, 0.02, 0.01))))
    for name in ("q_min", "q_max", "tau_max", "friction", "home", "surface"):
        assert_array_equal(getattr(plain, name), getattr(tipped, name))
    for name in ("body_mass", "body_inertia", "body_pos", "body_quat", "dof_armature"):
        assert_array_equal(getattr(plain.model, name), getattr(tipped.model, name))


def test_search_by_trac_ik_knows_a_derived_arm_whose_joints_turn_without_end():
    pytest.importorskip("trac_ik")
    model = edited(SIX, 'range="-6.28 6.28"', "")
    arm = robots.from_mjcf(model, site="tip")
    assert np.isinf(arm.q_max).any()
    pose, solver = arm.tool_pose(arm.home), trac_ik(arm)
    q = solver.ik(pose.position, np.array(arm.dynamics(arm.home, 0 * arm.home)["rotation"]), arm.home + 0.2)
    assert_allclose(arm.tool_pose(q).position, pose.position, rtol=0, atol=1e-4)


def test_thin_plates_and_weightless_parts_are_taken():
    """A plate's third moment is the sum of the others: rounding must not exceed what MuJoCo takes."""
    arm = robots.from_mjcf(mujoco.MjModel.from_xml_string(ELBOW), site="tip")
    build_plant(arm, WorldConfig())
    assert arm.tool.inertia.mass == pytest.approx(0.3)
