"""What is told of a run over the robot's protocol, from what really happened."""

import math

import numpy as np
import pytest

from contactsafe.experiments.robot_run import RobotRun, metrics_of, robot_runs
from contactsafe.hardware.ending import Ending
from contactsafe.report import terminal_table, write_report
from contactsafe.sim.franka_meetings import FOR_S, GOES_S, REST_S
from contactsafe.sim.franka_server import truth_dtype

ENDING = Ending("stopped", "done", "", True, 10_000, 1, 2, 0.5, 0.9, (30, 90, 200, 0), 10_001)


def run_of(controller, push_mm, bottle_n):
    truth = np.zeros(12_000, truth_dtype)
    truth["time"] = np.arange(len(truth)) * 1e-3
    truth["position"][:] = 0.5, 0.0, 0.07
    pushed = (truth["time"] >= REST_S) & (truth["time"] < REST_S + FOR_S)
    truth["position"][pushed, 0] += 1e-3 * push_mm
    truth["pushed_n"][pushed] = 25.0
    met = (truth["time"] > 1.0) & (truth["time"] < GOES_S)
    truth["arm_n"][met] = bottle_n
    truth["arm_n"][np.argmax(met)] = 2.0 * bottle_n
    truth["tip_n"][-1000:] = 7.0
    return RobotRun(controller, truth, ENDING, {"done, ink gone from board 1": 1.0, "done, board 2": 0.97}, True)


def test_pushes_and_bottles_are_measured_when_they_were_there():
    found = metrics_of(run_of("safe", 2.0, 10.0))
    assert found["pushed_mm"] == pytest.approx(2.0)
    assert found["met_peak_n"] == pytest.approx(20.0)
    assert found["met_steady_n"] == pytest.approx(10.0, rel=0.01)
    assert found["tip_peak_n"] == found["tip_contact_n"] == 7.0
    assert found["work_fraction"] == 0.97


def test_where_nothing_met_the_arm_nothing_is_said_of_it():
    run = run_of("safe", 2.0, 10.0)
    found = metrics_of(RobotRun(run.controller, run.truth, ENDING, {}, False))
    assert math.isnan(found["pushed_mm"])
    assert math.isnan(found["met_steady_n"])


def test_a_run_that_ended_before_it_began_has_a_table_all_the_same():
    empty = RobotRun("safe", np.zeros(0, truth_dtype), ENDING, {}, True)
    assert "How the runs went" in terminal_table([robot_runs([empty], 0)])


def test_two_runs_are_compared_against_a_third_and_drawn(tmp_path):
    results = robot_runs([run_of("safe", 2.0, 10.0), run_of("vices", 20.0, 120.0)], 0)
    text = terminal_table([results])
    assert "at most 1/3 of vices ok" in text
    assert "MISSED" not in text
    page = write_report(tmp_path, [results], {"seeds": [0], "command": "contactsafe run --simulated"})
    assert "force of the bottle on the arm" in page.read_text(encoding="utf-8")
