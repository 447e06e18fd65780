"""Capsules about geoms hold all of their surface, and are no larger than they need be."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from contactsafe.robot.enclosing import enclosing_capsule, geom_hull, placed

TOLERANCE = 1e-9
"""By which a point of a geom may stand out, m."""

_GEOM = mujoco.mjtGeom
SIZES = st.tuples(*[st.floats(0.005, 0.3)] * 3)


def geom(kind, size=(0.1, 0.1, 0.1), vertices=None):
    """Compile a model with one geom."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    if vertices is None:
        body.add_geom(type=kind, size=size)
    else:
        spec.add_mesh(name="hull", uservert=np.asarray(vertices).ravel())
        body.add_geom(type=_GEOM.mjGEOM_MESH, meshname="hull")
    return spec.compile()


def surface(model, count=400):
    """Sample a geom's surface in its frame, (count, 3), m; of a mesh points of its hull."""
    rng, size = np.random.default_rng(1), model.geom_size[0]
    on_sphere = rng.normal(size=(count, 3))
    on_sphere /= np.linalg.norm(on_sphere, axis=1, keepdims=True)
    turn = np.column_stack([np.cos(t := rng.uniform(0, 2 * np.pi, count)), np.sin(t)])
    kind = model.geom_type[0]
    if kind == _GEOM.mjGEOM_MESH:
        weights = rng.dirichlet(np.full(model.mesh_vertnum[0], 0.2), count)
        return np.concatenate([weights @ model.mesh_vert, model.mesh_vert])
    if kind == _GEOM.mjGEOM_ELLIPSOID:
        return on_sphere * size
    if kind == _GEOM.mjGEOM_CYLINDER:
        return np.column_stack([size[0] * turn, rng.choice([-1, 1], count) * size[1]])
    if kind == _GEOM.mjGEOM_BOX:
        return np.sign(on_sphere) * size
    length = 0.0 if kind == _GEOM.mjGEOM_SPHERE else size[1]
    return size[0] * on_sphere + np.sign(on_sphere[:, 2:]) * (0.0, 0.0, length)


def standing_out(capsule, points):
    """Return how far the furthest of some points is out of a capsule, m."""
    start, along = np.array(capsule.start), np.subtract(capsule.end, capsule.start)
    fraction = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
    return np.max(np.linalg.norm(points - start - fraction[:, None] * along, axis=1)) - capsule.radius


def volume(capsule):
    return (
        np.pi * capsule.radius**2 * (np.linalg.norm(np.subtract(capsule.end, capsule.start)) + 4 / 3 * capsule.radius)
    )


@pytest.mark.parametrize("kind", ["SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX"])
@settings(max_examples=30, deadline=None)
@given(size=SIZES)
def test_a_geom_lies_within_its_capsule(kind, size):
    model = geom(getattr(_GEOM, f"mjGEOM_{kind}"), size)
    assert standing_out(enclosing_capsule(geom_hull(model, 0)), surface(model)) < TOLERANCE


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), stretch=SIZES)
def test_a_mesh_lies_within_its_capsule_wherever_it_is_placed(seed, stretch):
    rng = np.random.default_rng(seed)
    model = geom(None, vertices=rng.normal(size=(30, 3)) * stretch)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R[:, 0] *= np.linalg.det(R)
    origin = rng.normal(size=3)
    capsule = enclosing_capsule(placed(geom_hull(model, 0), origin, R))
    assert standing_out(capsule, origin + surface(model) @ R.T) < TOLERANCE


def test_spheres_and_capsules_are_themselves():
    capsule = enclosing_capsule(geom_hull(geom(_GEOM.mjGEOM_CAPSULE, (0.03, 0.2, 0)), 0))
    assert capsule.radius == 0.03
    assert_allclose([capsule.start, capsule.end], [(0, 0, -0.2), (0, 0, 0.2)], atol=1e-15)
    sphere = enclosing_capsule(geom_hull(geom(_GEOM.mjGEOM_SPHERE, (0.03, 0, 0)), 0))
    assert sphere.radius == 0.03
    assert 0.0 < np.linalg.norm(np.subtract(sphere.end, sphere.start)) < 1e-5


@pytest.mark.parametrize(
    ("kind", "size", "times"),
    [("CYLINDER", (0.05, 0.3, 0.0), 1.12), ("BOX", (0.3, 0.05, 0.05), 2.1), ("ELLIPSOID", (0.05, 0.05, 0.3), 1.5)],
)
def test_long_geoms_are_enclosed_closely(kind, size, times):
    capsule = enclosing_capsule(geom_hull(geom(getattr(_GEOM, f"mjGEOM_{kind}"), size), 0))
    of_geom = {"CYLINDER": np.pi * 0.05**2 * 0.6, "BOX": 8 * 0.3 * 0.05**2, "ELLIPSOID": 4 / 3 * np.pi * 0.05**2 * 0.3}
    assert volume(capsule) < times * of_geom[kind]


def test_a_cube_is_enclosed_by_a_sphere():
    cube = geom(_GEOM.mjGEOM_BOX, (0.1, 0.1, 0.1))
    assert volume(enclosing_capsule(geom_hull(cube, 0))) <= 4 / 3 * np.pi * (0.1 * np.sqrt(3)) ** 3 * (1 + 1e-4)
