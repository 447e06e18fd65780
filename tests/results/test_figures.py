"""Curves of recordings, and the pictures and stage that go with them."""

import numpy as np
import pytest

from contactsafe.results.figures import Panel, component, largest, length, scalar
from contactsafe.results.recording import Recording, level_rectangle
from contactsafe.sim.truth import trace_dtype


@pytest.fixture
def run():
    rows = np.zeros(4, dtype=trace_dtype(7))
    rows["error"][:, :3] = (0.003, 0.004, 0.0)
    rows["error"][:, 3:] = 9.0  # rotation: no part of a length in metres
    rows["tau_arm"][2] = (1, -5, 2, 0, 0, 0, 0)
    rows["obstacle_force"] = (0, 1, 2, 3)
    return Recording("bottle", "safe", 0, rows, pictures=np.arange(3, dtype=np.uint8)[:, None, None], picture_every=2)


@pytest.mark.parametrize(
    ("curve", "values"),
    [
        (scalar("obstacle_force"), (0, 1, 2, 3)),
        (component("error", 1, 1000.0), (4, 4, 4, 4)),
        (length("error", 1000.0), (5, 5, 5, 5)),
        (largest("tau_arm"), (0, 0, 5, 0)),
    ],
)
def test_curves_are_what_their_names_say(run, curve, values):
    np.testing.assert_allclose(curve(run), values)


@pytest.mark.parametrize(("unit", "title"), [("N", "contact force (N)"), ("", "contact force")])
def test_a_panels_title_has_its_unit(unit, title):
    assert Panel("contact force", unit, scalar("obstacle_force")).title == title


@pytest.mark.parametrize(("tick", "value"), [(0, 0), (1, 0), (2, 1), (5, 2), (99, 2)])
def test_a_picture_stays_until_the_next(run, tick, value):
    assert run.picture(tick) == value


def test_a_recording_without_pictures_has_none(run):
    assert Recording("bottle", "safe", 0, run.trace).picture(0) is None


def test_a_rectangle_goes_along_x_first():
    corners = np.array(level_rectangle((0.5, 0.1, 0.01), (0.4, 0.6)))
    np.testing.assert_allclose(corners.mean(axis=0), (0.5, 0.1, 0.01))
    np.testing.assert_allclose(corners[1] - corners[0], (0.4, 0.0, 0.0))
    np.testing.assert_allclose(corners[3] - corners[0], (0.0, 0.6, 0.0))
