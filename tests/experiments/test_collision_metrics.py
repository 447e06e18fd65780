"""What is measured of a collision, from traces made up for it."""

import numpy as np
import pytest

from contactsafe.control.codes import COMPLY, FREE
from contactsafe.experiments.collision_metrics import METRICS, STEADY_S, collision_metrics
from contactsafe.robot import robots
from contactsafe.sim.truth import trace_dtype

TICKS = 2000


@pytest.fixture(scope="module")
def arm():
    return robots.panda()


@pytest.fixture
def free(arm):
    trace = np.zeros(TICKS, dtype=trace_dtype(arm.n))
    trace["time"], trace["q"], trace["mode"] = np.arange(TICKS) / 1000.0, arm.home, FREE
    return trace


def test_a_motion_that_meets_nothing_has_no_force_and_no_detection(arm, free):
    found = collision_metrics(free, free, arm)
    assert np.isnan(found.pop("detect_ms"))
    assert set(found.values()) == {0.0}


def test_force_impulse_detection_and_modes_are_those_of_the_trace(arm, free):
    trace = free.copy()
    trace["obstacle_force"][500:600] = 20.0
    trace["link"][512:600], trace["mode"][512:600] = 4, COMPLY
    trace["position"][500:600, 0] = 0.01
    found = collision_metrics(trace, free, arm)
    assert found["met"] == 1.0
    assert found["contact_peak_n"] == 20.0
    assert found["contact_steady_n"] == 0.0
    assert found["impulse_ns"] == pytest.approx(2.0)
    assert found["detect_ms"] == 12.0
    assert found["tool_error_mm"] == pytest.approx(10.0)
    assert found["tool_error_end_mm"] == 0.0
    assert found["comply_fraction"] == pytest.approx(88 / TICKS)
    assert found["mode_switches"] == 2.0


def test_steady_figures_are_of_the_last_part_alone(arm, free):
    trace = free.copy()
    trace["obstacle_force"][-int(1000 * STEADY_S) :] = 5.0
    trace["obstacle_force"][:1000] = 100.0
    assert collision_metrics(trace, free, arm)["contact_steady_n"] == pytest.approx(5.0)


def test_a_joint_that_comes_to_its_limit_counts_once_a_touch(arm, free):
    trace = free.copy()
    trace["q"][100:200, 3], trace["q"][300:400, 3] = arm.q_max[3], arm.q_max[3]
    assert collision_metrics(trace, free, arm)["limit_touches"] == 2.0


def test_every_figure_of_a_collision_that_is_shown_is_measured(arm, free):
    assert {metric.name for metric in METRICS} <= set(collision_metrics(free, free, arm))
