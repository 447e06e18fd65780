"""Pushes as people give them: scenes are what they claim, figures are what they say, trials are reproducible."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsafe import presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.onsets import pushed_links
from contactsafe.experiments.push_metrics import FLOOR_MM, METRICS, against, push_metrics
from contactsafe.experiments.push_scenes import (
    AFTER_S,
    FORCE_N,
    HELD_S,
    RAMP_S,
    inclined,
    posture_at,
    sample_angle,
    sample_pushed_motion,
    sample_touchable_point,
)
from contactsafe.experiments.pushes import WITH_WRENCH, WITHOUT, compared, pushes, run_pushed, run_pushes
from contactsafe.experiments.registry import ENTRIES
from contactsafe.experiments.surfaces import clearance
from contactsafe.results.experiment import Trial
from contactsafe.robot import robots
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.shape import link_frames
from contactsafe.sim.config import REAL_SENSORS, WorldConfig
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import Worlds

ARMS = (robots.panda(), robots.fr3())
ARM = ARMS[0]


@given(st.integers(0, 5000), st.sampled_from(ARMS))
def test_a_touchable_point_lies_on_its_link_and_nothing_covers_it(seed, arm):
    link, point, inwards = sample_touchable_point(arm, arm.home, np.random.default_rng(seed))
    origins, rotations = link_frames(description_and_tool(arm)[0], arm.home[None])
    place = origins[0, link] + rotations[0, link] @ point
    assert link in pushed_links(arm)
    assert abs(clearance(arm, arm.home[None], place)) < 1e-6
    assert clearance(arm, arm.home[None], place - 1e-3 * inwards) > 0.5e-3 - 1e-9


@given(st.integers(0, 5000))
def test_a_push_is_inwards_or_sideways_never_outwards(seed):
    rng = np.random.default_rng(seed)
    inwards, angle = np.array([0.0, 0.6, 0.8]), sample_angle(rng)
    direction = inclined(inwards, angle, rng)
    assert np.linalg.norm(direction) == pytest.approx(1.0)
    assert direction @ inwards == pytest.approx(math.cos(angle), abs=1e-12)
    assert 0.0 <= angle <= 0.5 * math.pi


@pytest.mark.parametrize("seed", range(12))
def test_a_scene_keeps_its_bounds_and_depends_on_its_seed_alone(seed):
    scene = sample_pushed_motion(ARM, seed)
    assert repr(scene) == repr(sample_pushed_motion(ARM, seed))
    assert FORCE_N[0] <= np.linalg.norm(scene.force) <= FORCE_N[1]
    assert RAMP_S[0] <= scene.ramp_s <= RAMP_S[1]
    assert not scene.slides
    assert scene.duration_s == pytest.approx(scene.meets_s + scene.ramp_s + HELD_S + AFTER_S)
    q = posture_at(ARM, scene, scene.meets_s)
    assert ((q > ARM.q_min) & (q < ARM.q_max)).all()
    origins, rotations = link_frames(description_and_tool(ARM)[0], q[None])
    place = origins[0, scene.link] + rotations[0, scene.link] @ scene.point
    assert abs(clearance(ARM, q[None], place)) < 1e-6


def test_scenes_hold_and_move():
    holds = [sample_pushed_motion(ARM, seed).holds for seed in range(30)]
    assert 10 <= sum(holds) <= 28


def traces(scene, away_mm):
    """Make up a run in which the tool is away from its calm run by so much: amid the push, after it, at the end."""
    calm = np.zeros(round(1000 * scene.duration_s), dtype=trace_dtype(ARM.n))
    pushed = calm.copy()
    onset, release = round(1000 * scene.meets_s), round(1000 * scene.release_s)
    pushed["position"][onset + 100, 1] = away_mm[0] / 1000.0
    pushed["position"][release + 10, 2] = away_mm[1] / 1000.0
    pushed["position"][-1, 0] = away_mm[2] / 1000.0
    pushed["mode"][onset + 20 :], pushed["mode"][onset + 90 :] = 1, 2
    pushed["q"][onset + 50 :, 3] = 0.002
    return pushed, calm


def test_figures_are_of_the_push_and_of_what_comes_after():
    scene = sample_pushed_motion(ARM, 3)
    found = push_metrics(*traces(scene, (12.0, 30.0, 4.0)), scene)
    assert found["tool_displacement_mm"] == pytest.approx(12.0)
    assert found["tool_displacement_after_mm"] == pytest.approx(30.0)
    assert found["tool_error_end_mm"] == pytest.approx(4.0)
    assert (found["report_ms"], found["reject_ms"]) == (20.0, 90.0)
    assert found["joint_speed_peak_rad_s"] == pytest.approx(2.0)
    declared = {metric.name for metric in METRICS} - {"displacement_ratio", "worse"}
    assert declared <= set(found)


def test_a_contact_reported_before_the_push_has_no_time_since_it():
    """It was 0 ms, the best there can be."""
    scene = sample_pushed_motion(ARM, 3)
    pushed, calm = traces(scene, (12.0, 30.0, 4.0))
    pushed["mode"][: round(1000 * scene.meets_s) + 1] = 2
    found = push_metrics(pushed, calm, scene)
    assert math.isnan(found["report_ms"])
    assert math.isnan(found["reject_ms"])
    assert (found["reported_early"], found["never_rejected"]) == (1.0, 0.0)


def test_a_tool_that_is_late_is_displaced_but_on_its_path():
    scene = next(scene for scene in (sample_pushed_motion(ARM, seed) for seed in range(30)) if not scene.holds)
    calm = np.zeros(round(1000 * scene.duration_s), dtype=trace_dtype(ARM.n))
    late = calm.copy()
    late["position"] -= 0.05 * scene.path / scene.length_m
    found = push_metrics(late, calm, scene)
    assert found["tool_displacement_mm"] == pytest.approx(50.0)
    assert found["tool_off_path_mm"] == pytest.approx(0.0, abs=1e-9)


@given(st.floats(0.0, 500.0))
def test_a_run_is_never_worse_than_itself(mm):
    assert against({"tool_displacement_mm": mm}, {"tool_displacement_mm": mm}) == {
        "baseline_mm": mm,
        "displacement_ratio": 1.0,
        "worse": 0.0,
    }


@pytest.mark.parametrize(
    ("mm", "before", "worse"), [(5.9, 1.0, 0.0), (6.1, 1.0, 1.0), (59.0, 50.0, 0.0), (61.0, 50.0, 1.0)]
)
def test_worse_takes_both_five_millimetres_and_twenty_percent(mm, before, worse):
    assert against({"tool_displacement_mm": mm}, {"tool_displacement_mm": before})["worse"] == worse


def test_a_push_that_does_nothing_counts_as_a_millimetre():
    assert against({"tool_displacement_mm": 0.0}, {"tool_displacement_mm": 4.0})["displacement_ratio"] == FLOOR_MM / 4.0
    assert against({"tool_displacement_mm": 0.1}, {"tool_displacement_mm": 0.0})["displacement_ratio"] == 1.0


def test_trials_are_compared_with_the_same_seed_in_the_same_scenario():
    figures = {("a", "x"): 10.0, ("b", "x"): 40.0, ("a", "y"): 20.0, ("b", "y"): 20.0}
    trials = [Trial(scenario, name, 0, {"tool_displacement_mm": mm}) for (scenario, name), mm in figures.items()]
    assert [trial.metrics["displacement_ratio"] for trial in compared(trials, "x")] == [1.0, 1.0, 2.0, 0.5]


def test_an_arm_that_nobody_pushes_is_not_displaced():
    scene = sample_pushed_motion(ARM, 1)
    worlds = Worlds(ARM, WorldConfig(scene.plant, REAL_SENSORS, fixtures=()), presets.safe(), 1, [1])
    first, second = (run_pushed(worlds, [scene], with_push=False)[0] for _ in range(2))
    worlds.close()
    found = push_metrics(first, second, scene)
    assert found["tool_displacement_mm"] == found["tool_error_end_mm"] == 0.0


def test_a_trial_is_the_same_alone_and_among_others_and_tables_count_all():
    controllers = {"vices": presets.vices(), "again": presets.vices()}
    result = run_pushes(controllers, range(3))
    assert {trial.scenario for trial in result.trials} == {WITH_WRENCH, WITHOUT}
    assert all(trial.metrics["worse"] == 0.0 and trial.metrics["displacement_ratio"] == 1.0 for trial in result.trials)
    assert all(trial.metrics["tau_peak_nm"] > 0.0 for trial in result.trials)
    verdict, kinds = result.tables
    assert verdict.as_records()[0]["again, with wrench"] == 3
    assert sum(row["trials"] for row in kinds.as_records() if row["push"].startswith("link")) == 3
    assert sum(row["trials"] for row in kinds.as_records() if row["push"].startswith("ramp")) == 3
    alone = run_pushes(controllers, [1])
    assert repr([t for t in result.trials if t.seed == 1]) == repr(list(alone.trials))


def test_the_experiment_counts_its_trials():
    config, done = ExperimentConfig(("vices",), trials=2), []
    result = pushes(config, done.append)
    assert sum(done) == len(result.trials) == ENTRIES["pushes"].count(config) == 4
    assert [recording.scenario for recording in result.recordings] == [WITH_WRENCH, WITHOUT]


def test_nothing_to_run_is_refused():
    with pytest.raises(InvalidInputError, match=r"^0 controllers, 1 seeds; give one or more of each$"):
        run_pushes({}, [0])
