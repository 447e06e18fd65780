"""Detection: pushes are what they claim to be, figures are what they say, and runs are reproducible."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe import presets
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments import false_alarms
from contactsafe.experiments.collision_motions import sample_motion
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.detection import detection, reporting
from contactsafe.experiments.false_alarms import FREE, SLIDING, false_alarm_trials, sample_strokes
from contactsafe.experiments.onsets import (
    CONTACT,
    STEP,
    Push,
    contact_metrics,
    push_trials,
    pushed_links,
    sample_push,
    step_metrics,
)
from contactsafe.experiments.registry import ENTRIES
from contactsafe.robot import robots
from contactsafe.sim.config import NO_NOISE, WorldConfig
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds

ARM = robots.panda()
PUSH = Push(5, np.zeros(3), np.array([0.0, 20.0, 0.0]), np.array([3.0, 0, 0, 0, 0.5, 0, 0]))


@pytest.mark.parametrize("seed", range(5))
def test_a_push_puts_the_torque_on_the_joints_that_it_claims(seed):
    """The simulator's own Jacobian says the same."""
    push = sample_push(ARM, ARM.home, np.random.default_rng(seed), CONTACT)
    worlds = Worlds(ARM, WorldConfig(sensors=NO_NOISE), presets.vices(), 1, 0)
    worlds.reset(0, ARM.home)
    worlds.push(0, f"link{push.link}", push.point, push.force, 0.0, 1.0, ramp_s=0.001)
    trace = np.zeros((1, MAX_TICKS), dtype=trace_dtype(ARM.n))
    worlds.run(1, trace)
    assert_allclose(trace["tau_arm"][0, 0], push.torque, atol=1e-2)
    assert 10.0 <= np.linalg.norm(push.force) <= 60.0


@pytest.mark.parametrize("seed", range(5))
def test_a_step_puts_3_nm_on_its_largest_joint_with_100_n_at_most(seed):
    push = sample_push(ARM, ARM.home, np.random.default_rng(seed), STEP)
    assert np.abs(push.torque).max() == pytest.approx(3.0)
    assert np.linalg.norm(push.force) <= 100.0
    assert push.link in pushed_links(ARM)
    assert not push.torque[push.link :].any()


def trace(reported_at, link=0):
    rows = np.zeros(67, dtype=trace_dtype(7))
    if reported_at is not None:
        rows["mode"][reported_at:], rows["link"][reported_at:] = 1, link
    return rows


@pytest.mark.parametrize(
    ("reported_at", "figures"), [(12, (12, 1, 1)), (16, (16, 0, 1)), (31, (31, 0, 0)), (None, (np.nan, 0, 0))]
)
def test_time_to_report_counts_from_the_onset(reported_at, figures):
    found = step_metrics(trace(reported_at), PUSH)
    assert_allclose([found[name] for name in ("detect_ms", "within_15_ms", "within_30_ms")], figures)
    assert found["reported_early"] == 0.0


def test_a_contact_reported_before_the_push_is_no_detection():
    found = step_metrics(trace(0), PUSH)
    assert found["reported_early"] == 1.0
    assert np.isnan([found[name] for name in ("detect_ms", "within_15_ms", "within_30_ms")]).all()


def test_the_link_is_the_one_named_after_30_ms():
    right, wrong, none = (contact_metrics(trace(*case), PUSH) for case in ((20, 5), (30, 4), (31, 5)))
    assert [case["link_named"] for case in (right, wrong, none)] == [5.0, 4.0, 0.0]
    assert [case["link_right"] for case in (right, wrong, none)] == [1.0, 0.0, 0.0]
    assert right["own_torque_nm"] == 0.5


def test_a_pushed_scene_does_the_same_alone_and_among_others():
    among = push_trials(ARM, "safe", presets.safe(), range(4), STEP)
    assert repr(push_trials(ARM, "safe", presets.safe(), [2], STEP)) == repr(among[2:3])
    assert {trial.scenario for trial in among} == {STEP}


def test_strokes_go_to_and_fro_on_their_path_no_faster_than_their_speed():
    stroke = sample_strokes(ARM, 0, 1)[0]
    places = np.array([stroke.target(time_s) for time_s in np.arange(0.0, 20.0, 0.001)])
    fraction = (places - stroke.start.position) @ stroke.path / stroke.length_m**2
    assert fraction.min() == 0.0
    assert fraction.max() == pytest.approx(1.0, abs=1e-4)
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1).max() / 0.001
    assert speed == pytest.approx(stroke.speed_m_s, rel=1e-3)


def test_strokes_leave_holds_out():
    strokes = sample_strokes(ARM, 0, 8)
    holds = [seed for seed in range(strokes[-1].seed) if sample_motion(ARM, seed).holds]
    assert holds
    assert not {stroke.seed for stroke in strokes} & set(holds)


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(false_alarms, "STROKES_S", 1.0)


@pytest.mark.usefixtures("short")
def test_a_controller_that_is_never_sure_gives_false_alarms():
    strokes = sample_strokes(ARM, 0, 2)
    (first, _) = false_alarm_trials(ARM, "nervous", presets.safe().with_(residual_threshold=0.05), strokes)
    (calm, _) = false_alarm_trials(ARM, "calm", presets.safe().with_(residual_threshold=50.0), strokes)
    assert first.metrics["false_alarms"] >= 1.0
    assert first.metrics["false_contact_s"] > 0.5
    assert calm.metrics == {"false_alarms": 0.0, "false_contact_s": 0.0, "minutes": 1 / 60, "touched": 0.0}


@pytest.mark.usefixtures("short")
def test_the_experiment_counts_its_trials_and_sums_up():
    config = ExperimentConfig(("vices", "safe"), trials=3, minutes=0.05)
    done = []
    result = detection(config, done.append)
    assert sum(done) == ENTRIES["detection"].count(config) == len(result.trials) == 3 + 3 + 3
    assert {trial.controller for trial in result.trials} == {"safe"}
    assert set(result.spreads()) <= {STEP, CONTACT, FREE, SLIDING}
    alarms, links = result.tables
    assert alarms.as_records()[0]["minutes watched"] == pytest.approx(0.05)
    kept = [t for t in result.trials if t.scenario == CONTACT and not t.metrics["reported_early"]]
    assert sum(row["contacts"] for row in links.as_records()) == len(kept)
    for row in links.as_records():
        assert row["contacts"] == sum(value for name, value in row.items() if name.endswith(" named"))


def test_blind_controllers_alone_are_refused():
    with pytest.raises(InvalidInputError, match=r"^none of vices reports contacts; choose paper or safe$"):
        reporting(("vices",))
