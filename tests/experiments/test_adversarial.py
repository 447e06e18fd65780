"""Adversarial targets: what counts as a violation, and that a run is its seed's."""

import functools

import numpy as np
import pytest

from contactsafe.control import presets
from contactsafe.control.records import target_dtype
from contactsafe.experiments.adversarial import METRICS, adversarial, corrupt_target, limit_metrics, run_adversarial
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.robot import robots
from contactsafe.sim.truth import trace_dtype

ARM = robots.panda()
SAFE = presets.safe()
ZERO = ("not_finite", "torque_violations", "torque_rate_violations", "joint_range_violations")


def quiet(ticks=100):
    rows = np.zeros(ticks, dtype=trace_dtype(7))
    rows["time"] = np.arange(ticks) / 1000
    rows["q"] = ARM.home
    return rows


def test_an_arm_at_rest_violates_nothing():
    found = limit_metrics(quiet(), ARM, SAFE)
    assert all(found[name] == 0.0 for name in ZERO)
    assert found["energy_given_j"] == found["energy_most_of_bound"] == found["joint_range_beyond_mrad"] == 0.0
    assert found["seconds"] == 0.1


def test_each_violation_is_counted_by_its_own_metric():
    rows = quiet()
    rows["torque"][10, 3] = np.nan
    assert limit_metrics(rows, ARM, SAFE)["not_finite"] == 1.0
    rows = quiet()
    rows["torque"][50:52, 2] = ARM.tau_max[2] + 1e-6
    found = limit_metrics(rows, ARM, SAFE)
    assert (found["torque_violations"], found["torque_rate_violations"]) == (2.0, 2.0)
    rows = quiet()
    rows["q"][20:25, 1] = ARM.q_max[1] + 0.002
    found = limit_metrics(rows, ARM, SAFE)
    assert found["joint_range_violations"] == 5.0
    assert found["joint_range_beyond_mrad"] == pytest.approx(2.0)


def test_a_step_at_the_rate_limit_is_none_too_many():
    rows = quiet()
    rows["torque"][:, 0] = np.minimum(np.arange(100) * ARM.torque_rate_max * 0.001, ARM.tau_max[0])
    assert limit_metrics(rows, ARM, SAFE)["torque_rate_violations"] == 0.0


def test_energy_is_what_the_arm_does_against_the_external_torque():
    rows = quiet(201)
    rows["q"][:, 0] += np.linspace(0.0, 0.1, 201)
    rows["tau_arm"][:, 0] = -5.0  # pressed against
    found = limit_metrics(rows, ARM, SAFE)
    assert found["energy_given_j"] == pytest.approx(0.5)
    allowed = SAFE.limits.tank_j + SAFE.limits.tank_power_w * rows["time"][1:]
    assert found["energy_most_of_bound"] == pytest.approx((np.linspace(0, 0.5, 201)[1:] / allowed).max())


def test_corrupt_targets_hold_everything_a_target_should_not():
    rng = np.random.default_rng(0)
    targets = np.zeros(400, dtype=target_dtype(7))
    for target in targets:
        corrupt_target(target, ARM, rng)
    assert not np.isfinite(targets["position"]).all()
    finite = targets["position"][np.isfinite(targets["position"]).all(axis=1)]
    assert np.abs(finite).max() > 100.0
    assert (targets["K_task"] == -5.0).any()
    assert np.isnan(targets["quat"]).any()
    beyond = targets["q_posture"][np.isfinite(targets["q_posture"]).all(axis=1)]
    assert (beyond > ARM.q_max).any()


def test_a_run_is_its_seeds_alone():
    both = run_adversarial(ARM, SAFE, [3, 4], 340)
    alone = run_adversarial(ARM, SAFE, [4], 340)
    assert repr(both[1]) == repr(alone[0])


def test_safe_keeps_every_limit(monkeypatch):
    short = functools.partial(run_adversarial, ticks=1000)
    monkeypatch.setattr("contactsafe.experiments.adversarial.run_adversarial", short)
    told = []
    found = adversarial(ExperimentConfig(("safe",), 3, 11), told.append)
    assert told == [3]
    assert [trial.seed for trial in found.trials] == [11, 12, 13]
    for trial in found.trials:
        assert all(trial.metrics[name] == 0.0 for name in ZERO)
        assert trial.metrics["energy_most_of_bound"] < 1.0
    assert {metric.name for metric in METRICS} <= set(found.trials[0].metrics)
