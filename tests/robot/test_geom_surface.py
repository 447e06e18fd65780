"""The surface of a user's own arm: points on the surface of its geoms."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.robot.worlds import SIX, cell

from contactsafe.robot import robots

SCENE = """
<mujoco>
  <asset><mesh name="brick" vertex="{corners}"/></asset>
  <worldbody>
    <geom size="0.3"/>
    <body name="upper" pos="0.1 0 0.5">
      <joint name="a" axis="0 1 0"/>
      <geom size="0.1"/>
      <body name="lower" pos="0 0.1 0.3" euler="20 -40 60">
        <joint name="b" axis="1 0 1" pos="0.01 0.02 0.03" ref="20"/>
        <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
        {geoms}
        <site name="tip"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="a" ctrlrange="-5 5"/><motor joint="b" ctrlrange="-5 5"/></actuator>
</mujoco>
"""
"""Two links; the second one shows what is put into it."""

CORNERS = [(x, y, z) for x in (-0.03, 0.03) for y in (-0.05, 0.05) for z in (-0.2, 0.2)]
PLACED = 'pos="0.02 0.03 0.1" euler="30 10 50"'
SHAPES = {
    "sphere": f'<geom size="0.06" {PLACED}/>',
    "capsule": f'<geom type="capsule" size="0.05 0.15" {PLACED}/>',
    "cylinder": f'<geom type="cylinder" size="0.05 0.15" {PLACED}/>',
    "ellipsoid": f'<geom type="ellipsoid" size="0.04 0.06 0.1" {PLACED}/>',
    "box": f'<geom type="box" size="0.03 0.05 0.2" {PLACED}/>',
    "mesh": f'<geom type="mesh" mesh="brick" {PLACED}/>',
}


def showing(geoms):
    """Return a scene whose second link shows some geoms, and its arm."""
    corners = " ".join(str(number) for corner in CORNERS for number in corner)
    model = mujoco.MjModel.from_xml_string(SCENE.format(corners=corners, geoms=geoms))
    return model, robots.from_mjcf(model, site="tip")


def seen_from_geom(model, arm, geom):
    """Return points and normals of the second link's surface in a geom's frame, (P, 3) each."""
    assert_array_equal(arm.surface[:, 0], 2)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    R, origin = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    return (arm.surface[:, 1:4] + data.xanchor[1] - origin) @ R, arm.surface[:, 4:] @ R


def above(shape, p, size):
    """Return how far points (P, 3) are above a shape's surface, m, in its frame; exact near the surface."""
    radial = np.linalg.norm(p[:, :2], axis=1)
    if shape == "sphere":
        return np.linalg.norm(p, axis=1) - size[0]
    if shape == "capsule":
        return np.hypot(radial, p[:, 2] - np.clip(p[:, 2], -size[1], size[1])) - size[0]
    if shape == "cylinder":
        return np.maximum(radial - size[0], np.abs(p[:, 2]) - size[1])
    if shape == "ellipsoid":
        return (np.linalg.norm(p / size, axis=1) - 1.0) / np.linalg.norm(p / size**2, axis=1)
    return np.max(np.abs(p) - size, axis=1)


@pytest.mark.parametrize("shape", SHAPES)
def test_points_lie_on_the_surface_with_unit_normals_outwards(shape):
    """And a step along the normal leads as far away from the surface."""
    model, arm = showing(SHAPES[shape])
    size = np.sort(np.abs(CORNERS[0])) if shape == "mesh" else model.geom_size[2]
    points, normals = seen_from_geom(model, arm, 2)
    if shape == "mesh":  # MuJoCo turns meshes to their principal axes
        order = np.argsort(np.ptp(points, axis=0))
        points, normals = points[:, order], normals[:, order]
    step = 1e-5
    assert len(points) == 480
    assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=0, atol=1e-9)
    assert_allclose(above(shape, points, size), 0.0, rtol=0, atol=1e-7)
    assert_allclose(above(shape, points + step * normals, size), step, rtol=1e-3, atol=1e-7)


@pytest.mark.parametrize("shape", ["sphere", "box"])
def test_points_are_evenly_spread(shape):
    """All of the surface is near a point: no further than twice the spacing that as many on a grid would have."""
    model, arm = showing(SHAPES[shape])
    points, _ = seen_from_geom(model, arm, 2)
    size, rng = model.geom_size[2], np.random.default_rng(0)
    if shape == "sphere":
        area, surface = 4.0 * np.pi * size[0] ** 2, rng.normal(size=(500, 3))
        surface *= size[0] / np.linalg.norm(surface, axis=1, keepdims=True)
    else:
        area, surface = 8.0 * (size[0] * size[1] + size[1] * size[2] + size[0] * size[2]), rng.uniform(-1, 1, (500, 3))
        surface[np.arange(500), np.arange(500) % 3] = np.sign(surface[:, 0])
        surface *= size
    gaps = np.linalg.norm(surface[:, None] - points, axis=2).min(axis=1)
    assert gaps.max() < 2.0 * np.sqrt(area / len(points))


def test_both_sides_of_a_thin_plate_are_skin():
    model, arm = showing('<geom type="box" size="0.1 0.1 0.0005"/>')
    _, normals = seen_from_geom(model, arm, 2)
    assert 150 < np.sum(normals[:, 2] > 0.9) < 330
    assert 150 < np.sum(normals[:, 2] < -0.9) < 330


def test_what_lies_within_another_geom_of_the_link_is_no_skin():
    model, arm = showing('<geom size="0.05"/><geom size="0.05" pos="0.04 0 0"/>')
    for geom in (2, 3):
        points, _ = seen_from_geom(model, arm, geom)
        assert np.linalg.norm(points, axis=1).min() > 0.05 - 1e-9
        assert np.any(np.linalg.norm(points, axis=1) < 0.05 + 1e-9)


VISUAL = '<geom size="0.09" contype="0" conaffinity="0" {}/>'


@pytest.mark.parametrize("look", ["", 'group="5"', 'rgba="0 0 0 0"'])
def test_geoms_that_do_not_collide_are_skin_only_where_no_other_does(look):
    model, arm = showing('<geom size="0.05"/>' + VISUAL.format(look))
    assert_allclose(np.linalg.norm(seen_from_geom(model, arm, 2)[0], axis=1), 0.05, rtol=1e-9)
    model, arm = showing(VISUAL.format(look))
    assert_allclose(np.linalg.norm(seen_from_geom(model, arm, 2)[0], axis=1), 0.09, rtol=1e-9)


@pytest.mark.parametrize("look", ['contype="0"', 'conaffinity="0"', 'rgba="0 0 0 0"', 'group="4"'])
def test_what_can_collide_is_skin_however_it_looks(look):
    model, arm = showing(f'<geom size="0.05" {look}/>' + VISUAL.format(""))
    assert_allclose(np.linalg.norm(seen_from_geom(model, arm, 2)[0], axis=1), 0.05, rtol=1e-9)


def test_what_the_last_link_carries_is_tool_and_no_skin():
    """Unless the link shows nothing itself; what another link carries is the link's."""
    tool = '<body name="tool"><geom size="0.02" pos="0 0 0.3"/></body>'
    _, alone = showing('<geom size="0.05"/>')
    _, carrying = showing('<geom size="0.05"/>' + tool)
    assert_array_equal(carrying.surface, alone.surface)
    model, bare = showing(tool)
    assert_allclose(np.linalg.norm(seen_from_geom(model, bare, 2)[0], axis=1), 0.02, rtol=1e-9)
    part = robots.from_mjcf(mujoco.MjModel.from_xml_string(SIX), site="tip", joints=["lift", "elbow", "wrist2"])
    assert set(part.surface[:, 0]) == {2, 3}
    assert np.ptp(part.surface[part.surface[:, 0] == 2, 1:4], axis=0).max() > 0.45  # forearm and first wrist


def test_arm_without_geoms_has_no_skin():
    assert showing("")[1].surface.shape == (0, 7)


@pytest.mark.parametrize("site", ["tip", "left/tcp"])
def test_every_link_beyond_the_first_has_its_share_of_480_points(site):
    arm = robots.from_mjcf(cell(), site=site)
    links, counts = np.unique(arm.surface[:, 0], return_counts=True)
    assert_array_equal(links, np.arange(2, arm.n + 1))
    assert_array_equal(counts, 480 // (arm.n - 1))


def test_same_scene_has_the_same_skin_and_is_left_as_it_was():
    model = cell()
    before = model.geom_group.copy(), model.geom_rgba.copy(), model.geom_matid.copy()
    first = robots.from_mjcf(model, site="left/tcp").surface
    assert_array_equal(first, robots.from_mjcf(model, site="left/tcp").surface)
    for now, then in zip((model.geom_group, model.geom_rgba, model.geom_matid), before, strict=True):
        assert_array_equal(now, then)
