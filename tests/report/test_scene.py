"""Pictures: everything is in view, nothing is distorted, and colours are the stage's."""

import base64
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread
from scipy.spatial import ConvexHull

from contactsafe.report.scene import View, fit, picture, visible_faces
from contactsafe.report.strip import moments, strips
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.robot.franka import WIPER
from contactsafe.robot.shape import arm_capsules, tip_rings
from contactsafe.tasks.insertion.scene import PEG

angles = st.floats(-3.0, 3.0)


@given(angles, st.floats(0.1, 1.5), st.integers(0, 100))
def test_a_view_turns_and_does_not_distort(azimuth, elevation, seed):
    view = View((0.1, 0.2, 0.3), (2.0, 1.0), azimuth, elevation)
    np.testing.assert_allclose(view.axes() @ view.axes().T, np.eye(3), atol=1e-12)
    a, b = np.random.default_rng(seed).uniform(-1, 1, (2, 3))
    p, q = view.project(np.array([a, b]), 200.0, 200.0)
    scale = view.scale(200.0, 200.0)
    assert np.linalg.norm([(p - q)[0] / scale, (p - q)[1] / scale, (p - q)[2]]) == pytest.approx(np.linalg.norm(a - b))
    np.testing.assert_allclose(view.project([view.target], 200.0, 200.0)[0][:2], (100.0, 100.0))


@pytest.fixture(scope="module")
def stage(fakes):
    return fakes.Wiping().stage


@pytest.fixture(scope="module")
def runs(fakes):
    return [fakes.record("bottle", name, 2.0, ((0.3, -0.2, 0.4), 2e3), (0.03, 0.1)) for name in ("vices", "safe")]


def test_arm_surface_and_obstacle_of_all_runs_are_in_view(stage, runs):
    view = fit(stage, runs)
    width = height = 300
    scale = view.scale(width, height)
    corners = view.project(np.array(stage.corners), width, height)
    assert (corners[:, :2] >= 0).all()
    assert (corners[:, :2] <= (width, height)).all()
    for run in runs:
        starts, ends, radii, _ = arm_capsules(stage.arm, stage.tool, run.trace["q"][::500])
        for centres in (starts, ends):
            places = view.project(centres, width, height)[..., :2]
            assert (places - scale * radii[:, None] >= 0).all()
            assert (places + scale * radii[:, None] <= (width, height)).all()


def image_in(svg):
    data = re.search(r'href="data:image/png;base64,([^"]+)"', svg).group(1)
    return (imread(io.BytesIO(base64.b64decode(data))) * 255).round().astype(int)


def test_what_lies_on_the_surface_has_the_stages_colours(stage, runs):
    red = replace(stage, colours={1: (255, 0, 0)})
    run = replace(runs[0], pictures=np.array([[[0, 1], [2, 1]]], np.uint8))
    shown = image_in(picture(red, fit(red, [run]), run, 0, 100, 100))
    np.testing.assert_array_equal(shown[0, 1], (255, 0, 0, 255))
    np.testing.assert_array_equal(shown[0, 0], (0, 0, 0, 0))
    np.testing.assert_array_equal(shown[1, 0], (0, 0, 0, 0))


def test_without_pictures_the_surface_is_empty(stage, runs):
    run = replace(runs[0], pictures=None)
    shown = picture(stage, fit(stage, [run]), run, 0, 100, 100)
    assert "<image" not in shown
    assert 'class="surface"' in shown


@pytest.mark.parametrize(("shape", "kind"), [((0.03, 0.0), "circle"), ((0.03, 0.1), "ellipse"), (None, None)])
def test_obstacles_are_spheres_or_cylinders_at_rest_and_now(stage, runs, shape, kind):
    run = replace(runs[0], obstacle=shape)
    shown = picture(stage, fit(stage, [run]), run, 1500, 100, 100)
    for name in ("rest", "obstacle"):
        assert (f'<{kind} class="{name}"' in shown) == (shape is not None)


def test_moments_tell_the_collision(runs):
    for run in runs:
        run.trace["obstacle_force"] = 0.0
    assert moments(runs) == [0, 500, 1000, 1499, 1999]
    runs[1].trace["obstacle_force"][800:900] = 5.0
    runs[1].trace["obstacle_force"][850] = 50.0
    assert moments(runs) == [0, 400, 800, 850, 1999]


def test_a_strip_has_a_row_a_controller_and_a_force_a_picture(stage, runs):
    trials = tuple(Trial(run.scenario, run.controller, run.seed, {}) for run in runs)
    shown = strips(Experiment("x", "X", "?", trials, recordings=tuple(runs)), stage)
    assert shown.count("<svg") == shown.count(" N</td>") == len(runs) * len(moments(runs))
    assert shown.index(">vices<") < shown.index(">safe<")


@given(st.sampled_from([WIPER, PEG]), angles, st.floats(-1.5, 1.5))
def test_the_visible_faces_of_a_tip_cover_its_outline_once(tool, azimuth, elevation):
    seen = tip_rings(tool) @ View((0.0, 0.0, 0.0), (1.0, 1.0), azimuth, elevation).axes().T
    outline = ConvexHull(seen[..., :2].reshape(-1, 2)).volume
    faces = visible_faces(seen)
    assert sum(polygon_area(face) for face in faces) == pytest.approx(outline)
    seen_edge_on = 1e-9  # of the outline: rounding decides whether such a face is there
    assert sum(polygon_area(face) > seen_edge_on * outline for face in faces) <= (3 if tool is WIPER else 2)


def polygon_area(outline):
    x, y = outline.T
    return 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
