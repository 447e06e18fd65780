"""The disturbance experiment, one seed: the same again for the same seed, and contact safety holds the tool better."""

from dataclasses import replace

import numpy as np
import pytest

from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.disturbance import PUSH_POINTS, disturbance, modes
from contactsafe.tasks.wiping.scenes import Wiping

TASK = Wiping()
MODES = modes(TASK)
ONE = ExperimentConfig(("vices", "safe"), trials=1, seed=0, task=TASK)


@pytest.fixture(scope="module")
def result():
    return disturbance(ONE)


def error(result, link, mode, controller):
    return result.spreads()[f"push on link {link} while {mode}"][controller]["error_max_mm"].max


def test_every_scenario_and_controller_is_there_with_a_recording(result):
    scenarios = {f"push on link {link} while {mode}" for link in PUSH_POINTS for mode in MODES}
    assert set(result.spreads()) == scenarios
    assert len(result.trials) == len(result.recordings) == len(scenarios) * 2
    assert {(r.scenario, r.controller) for r in result.recordings} == {
        (t.scenario, t.controller) for t in result.trials
    }


@pytest.mark.parametrize("mode", MODES)
def test_pushed_on_link_5_safe_strays_less_than_vices(result, mode):
    assert error(result, 5, mode, "safe") < 0.6 * error(result, 5, mode, "vices")


MISSED = pytest.mark.xfail(
    strict=False,  # over other seeds, and on other processors, it is now missed and now met
    reason="pushed on link 4 while it wipes, safe strays a third to half as far as vices",
)


@pytest.mark.parametrize("mode", [pytest.param(mode, marks=MISSED if mode == "wiping" else ()) for mode in MODES])
def test_safe_strays_a_third_as_far_as_vices(result, mode):
    assert error(result, 4, mode, "safe") < error(result, 4, mode, "vices") / 3


def test_the_same_seed_gives_the_same_figures(result):
    again = disturbance(replace(ONE, controllers=("safe",)))
    mine = {trial.scenario: trial.metrics for trial in result.trials if trial.controller == "safe"}
    assert {trial.scenario: trial.metrics for trial in again.trials} == mine


def test_another_seed_pushes_from_elsewhere(result):
    told = []
    other = disturbance(replace(ONE, controllers=("safe",), seed=1), told.append)
    assert sum(told) == len(other.trials)
    first = next(t for t in result.trials if t.controller == "safe")
    assert other.trials[0].metrics["error_max_mm"] != first.metrics["error_max_mm"]


def test_a_recording_shows_error_against_the_run_left_alone(result):
    for recording in result.recordings:
        before = recording.trace["time"] < 0.5
        assert np.abs(recording.trace["error"][before, :3]).max() < 1e-4
        assert np.abs(recording.trace["tau_arm"][~before]).max() > 1.0
