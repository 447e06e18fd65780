"""Rays meet what stands in their path, and their normals are those of the surface, in any version of MuJoCo."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe.robot.rays import _turned, cast

SCENE = """<mujoco><worldbody><body pos="0.1 0.2 0.3" euler="20 30 40">
  <geom type="{}" size="0.05 0.06 0.07" {}/></body></worldbody></mujoco>"""
GROUP = np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)


def scene(kind, more=""):
    model = mujoco.MjModel.from_xml_string(SCENE.format(kind, more))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def rays(model, data, count=60):
    """Yield starts and directions of rays towards the geom from all around it."""
    rng = np.random.default_rng(1)
    for _ in range(count):
        away, aim = rng.normal(size=3), rng.uniform(-0.03, 0.03, 3)
        start = data.geom_xpos[0] + 0.3 * away / np.linalg.norm(away)
        direction = data.geom_xpos[0] + aim - start
        yield start, direction / np.linalg.norm(direction)


def gradient(kind, model, data, point):
    """Return the outward normal at a point of the surface, world axes, from its equation."""
    R = data.geom_xmat[0].reshape(3, 3)
    at = R.T @ (point - data.geom_xpos[0]) / model.geom_size[0]
    if kind == "ellipsoid":
        normal = at / model.geom_size[0]
    else:
        normal = np.where(np.abs(at) == np.abs(at).max(), np.sign(at), 0.0)
    return R @ normal / np.linalg.norm(normal)


@pytest.mark.parametrize("kind", ["box", "ellipsoid"])
@pytest.mark.parametrize("turned", [False, True], ids=["as they are", "turned, as before MuJoCo 3.5"])
def test_normals_are_those_of_the_surface(kind, turned):
    model, data = scene(kind)
    found = 0
    for start, direction in rays(model, data):
        if turned:
            distance, normal = _turned(model, data, start, direction, GROUP)
        else:
            distances, normals = cast(model, data, start, direction[None], GROUP)
            distance, normal = distances[0], normals[0]
        expected = gradient(kind, model, data, start + distance * direction)
        if distance < 0.0 or abs(normal @ expected) < 0.999:  # beside an edge of the box
            continue
        found += 1
        assert_allclose(normal * np.sign(normal @ expected), expected, atol=1e-6)
    assert found > 50


def test_rays_hit_a_mesh_as_often_as_one_by_one():
    """Before MuJoCo 4.0 many at once missed nine in ten."""
    stone = "-0.04 0 0  0.05 0.01 0  0 0.06 0.01  0 -0.05 0.02  0.01 0 0.07  0 0.01 -0.03"
    text = SCENE.format("mesh", 'mesh="stone"').replace('size="0.05 0.06 0.07"', "")
    asset = f'<asset><mesh name="stone" vertex="{stone}"/></asset><worldbody>'
    model = mujoco.MjModel.from_xml_string(text.replace("<worldbody>", asset))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geom = np.zeros(1, dtype=np.int32)
    for start, direction in rays(model, data, 200):
        one = mujoco.mj_ray(model, data, start, direction, GROUP, True, -1, geom)
        assert_allclose(cast(model, data, start, direction[None], GROUP)[0][0], one, atol=1e-9)


def test_nothing_is_hit_beside_a_geom_and_of_other_groups():
    model, data = scene("box", 'group="2"')
    start, direction = next(rays(model, data))
    assert cast(model, data, start, direction[None], GROUP)[0][0] == -1.0
    assert _turned(model, data, start, direction, GROUP)[0] == -1.0
