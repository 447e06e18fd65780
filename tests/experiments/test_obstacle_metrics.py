"""Peak, steady part, impulse, torque and delay of a contact: one function, by the rules of either experiment."""

import math

import numpy as np
import pytest
from numpy.testing import assert_equal

from contactsafe.control.codes import FREE
from contactsafe.experiments import collision_metrics, joint_safety
from contactsafe.experiments.obstacle_metrics import last_part, obstacle_metrics
from contactsafe.robot import robots
from contactsafe.sim.truth import trace_dtype

TICKS = 4000
SHARED = ("met", "contact_peak_n", "contact_steady_n", "impulse_ns", "tau_peak_nm", "tau_steady_nm", "detect_ms")


def contact(met_at=1000, reported_at=1012, size_n=20.0):
    """A trace with one contact of a constant force from a tick on, and its report."""
    made = np.zeros(TICKS, dtype=trace_dtype(7))
    made["time"], made["mode"] = np.arange(TICKS) / 1000.0, FREE
    if met_at is not None:
        made["obstacle_force"][met_at:] = size_n
        made["tau_arm"][met_at:, 2] = -np.linspace(5.0, 2.0, TICKS - met_at)
    if reported_at is not None:
        made["link"][reported_at:] = 4
    return made


def by_hand(trace, steady_s):
    """The figures that no rule changes."""
    last, tau = trace["time"] > trace["time"][-1] - steady_s, np.abs(trace["tau_arm"]).max(axis=1)
    return {
        "contact_peak_n": trace["obstacle_force"].max(),
        "contact_steady_n": trace["obstacle_force"][last].mean(),
        "impulse_ns": trace["obstacle_force"].sum() / 1000.0,
        "tau_peak_nm": tau.max(),
        "tau_steady_nm": tau[last].mean(),
    }


@pytest.mark.parametrize("steady_s", [0.5, 2.0])
def test_figures_of_a_contact_are_the_same_by_either_rule(steady_s):
    strict = obstacle_metrics(contact(), steady_s, of_met_only=True, reported_before_ms=math.nan)
    loose = obstacle_metrics(contact(), steady_s, of_met_only=False, reported_before_ms=0.0)
    assert strict == loose == {"met": 1.0, **by_hand(contact(), steady_s), "detect_ms": 12.0}


@pytest.mark.parametrize(
    ("trace", "in_joint_safety", "in_collisions"),
    [
        (contact(), 12.0, 12.0),
        (contact(reported_at=None), math.nan, math.nan),
        (contact(reported_at=900), math.nan, 0.0),
        (contact(reported_at=1000), math.nan, 0.0),
        (contact(met_at=None), math.nan, math.nan),
        (contact(size_n=0.4), math.nan, math.nan),
    ],
    ids=["detected", "never detected", "reported before", "in the same tick", "met nothing", "hardly touched"],
)
def test_both_experiments_keep_their_own_rules(trace, in_joint_safety, in_collisions):
    """Joint safety has no figures of a run that met nothing, no delay of a contact reported before; collisions do."""
    met = bool((trace["obstacle_force"] > 0.5).any())
    shared = joint_safety.contact_metrics(trace)
    expected = by_hand(trace, 2.0) if met else dict.fromkeys(by_hand(trace, 2.0), math.nan)
    assert_equal({name: shared[name] for name in SHARED}, {"met": met, **expected, "detect_ms": in_joint_safety})
    shared = collision_metrics.collision_metrics(trace, trace, robots.panda())
    expected = {"met": met, **by_hand(trace, 0.5), "detect_ms": in_collisions}
    assert_equal({name: shared[name] for name in SHARED}, expected)


def test_the_last_part_ends_with_the_run():
    chosen = last_part(contact(), 0.5)
    assert chosen.sum() == 500
    assert chosen[-500:].all()
