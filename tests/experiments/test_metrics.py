"""Figures of one run, on traces made by hand."""

import math

import numpy as np
import pytest

from contactsafe.experiments.disturbance import PUSH_N, PUSH_POINTS, PUSH_S, deviation_metrics, push_force
from contactsafe.experiments.joint_safety import contact_metrics, worth_showing
from contactsafe.experiments.task_safety import force_metrics
from contactsafe.results.recording import Recording
from contactsafe.sim.truth import trace_dtype


def trace(ticks):
    made = np.zeros(ticks, dtype=trace_dtype(7))
    made["time"] = np.arange(ticks) / 1000
    return made


def test_force_counts_only_while_the_tool_touches():
    run = trace(1000)
    run["tool_force"][500:, 2] = 6.0
    run["tool_force"][500:600, 0] = 8.0
    run["mode"][900:] = 1
    run["K_task"][:500, 2], run["K_task"][500:, 2] = 80.0, 200.0
    metrics = force_metrics(run)
    assert metrics["tool_force_median_n"] == 6.0
    assert metrics["tool_force_peak_n"] == metrics["tool_force_p95_n"] == 10.0
    assert metrics["landing_peak_n"] == 10.0
    assert (metrics["stiffness_z_free"], metrics["stiffness_z_contact"]) == (80.0, 200.0)
    assert metrics["contact_mode_fraction"] == 0.1


def test_a_tool_that_never_touched_has_no_force_of_contact():
    metrics = force_metrics(trace(10))
    assert metrics["tool_force_peak_n"] == 0.0
    assert math.isnan(metrics["tool_force_median_n"])
    assert math.isnan(metrics["landing_peak_n"])


def collision():
    """Nothing for 1 s, an impact of 80 N for 20 ms, 20 N from there on; detected after 15 ms."""
    run = trace(4000)
    run["obstacle_force"][1000:1020], run["obstacle_force"][1020:] = 80.0, 20.0
    run["tau_arm"][1000:1020, 2], run["tau_arm"][1020:, 3] = -30.0, 7.0
    run["residual"][1500:, 3] = 6.5
    run["link"][1015:] = 4
    run["mode"][1015:2000] = 1
    run["tool_force"][:, 2] = 5.0
    return run


def test_a_collision_has_a_peak_a_steady_part_and_a_time_to_its_detection():
    metrics = contact_metrics(collision())
    assert metrics == {
        "met": 1.0,
        "contact_peak_n": 80.0,
        "contact_steady_n": 20.0,
        "impulse_ns": pytest.approx(80 * 0.02 + 20 * 2.98),
        "tau_peak_nm": 30.0,
        "tau_steady_nm": 7.0,
        "residual_peak_nm": 6.5,
        "residual_steady_nm": 6.5,
        "detect_ms": 15.0,
        "tool_force_peak_n": 5.0,
        "mode_switches": 2.0,
    }


def test_a_collision_that_was_never_detected_has_no_time():
    run = collision()
    run["link"] = 0
    assert math.isnan(contact_metrics(run)["detect_ms"])


def test_an_arm_that_met_nothing_has_no_figures_but_that():
    run = collision()
    run["obstacle_force"] = 0.0
    metrics = contact_metrics(run)
    assert metrics.pop("met") == 0.0
    assert all(math.isnan(value) for value in metrics.values())
    assert set(metrics) == set(contact_metrics(collision())) - {"met"}


def test_deviation_is_from_the_run_left_alone_and_while_pushed():
    calm, pushed = trace(2500), trace(2500)
    calm["position"][:, 1] = pushed["position"][:, 1] = np.linspace(0, 0.1, 2500)
    pushed["position"][600, 0] += 0.004
    pushed["position"][1900:2000, 2] -= 0.002
    pushed["position"][2200, 1] += 0.009
    pushed["tool_force"][3] = (3.0, 0.0, 4.0)
    metrics = deviation_metrics(pushed, calm)
    expected = {
        "error_x_mm": 4.0, "error_y_mm": 0.0, "error_z_mm": 2.0, "error_max_mm": 4.0, "error_end_mm": 2.0,
        "error_after_mm": 9.0, "tool_force_peak_n": 5.0,
    }  # fmt: skip
    assert metrics == pytest.approx(expected, abs=1e-9)


def test_pushes_are_level_of_one_size_and_their_seeds():
    for link in PUSH_POINTS:
        forces = np.array([push_force(seed, link) for seed in range(50)])
        assert np.linalg.norm(forces, axis=1) == pytest.approx(np.full(50, PUSH_N))
        assert not forces[:, 2].any()
        assert len({tuple(force) for force in forces}) == 50
        assert np.array_equal(forces[3], push_force(3, link))
    assert PUSH_S[1] - PUSH_S[0] >= 1.0


def test_shown_is_the_first_seed_with_which_every_arm_met_the_obstacle():
    def run(seed, force):
        made = trace(5)
        made["obstacle_force"][2] = force
        return Recording("bottle", "safe", seed, made)

    runs = {4: [run(4, 9.0), run(4, 0.0)], 5: [run(5, 9.0), run(5, 9.0)], 6: [run(6, 9.0), run(6, 9.0)]}
    assert [recording.seed for recording in worth_showing(runs)] == [5, 5]
    assert [recording.seed for recording in worth_showing({4: runs[4]})] == [4, 4]
