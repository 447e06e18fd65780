"""Comparisons and worst trials from trials made up for the purpose."""

import math
from dataclasses import astuple

import pytest

from contactsafe.experiments.verdict import compare
from contactsafe.experiments.verdict_tables import WORST, verdict_table, worst_tables
from contactsafe.results.experiment import Trial

NAN = float("nan")


def trial(controller, seed, peak, steady=0.0, met=1.0, stiffness=1e4, detect=NAN, plant="real", **more):
    metrics = {
        "met": met,
        "contact_peak_n": peak,
        "contact_steady_n": steady,
        "obstacle_stiffness_n_m": stiffness,
        "detect_ms": detect,
        "mode_switches": 0.0,
        "limit_touches": 0.0,
        "link": 5.0,
        "speed_m_s": 0.2,
    }
    return Trial("sweep in free air", controller, seed, metrics | more, plant)


def compared(mine, theirs):
    """Compare peaks against the baseline's, seed by seed."""
    return compare(
        [trial("safe", i, peak) for i, peak in enumerate(mine)],
        [trial("vices", i, peak) for i, peak in enumerate(theirs)],
    )


@pytest.mark.parametrize(
    ("peak", "before", "regressions"), [(106, 100, 1), (104.9, 100, 0), (14, 10, 0), (15.1, 10, 1)]
)
def test_a_peak_regression_takes_both_five_percent_and_five_newtons(peak, before, regressions):
    assert compared([peak], [before]).peak_regressions == regressions


def test_peak_ratio_is_the_median_over_trials_not_of_medians():
    assert compared([10, 10, 100], [20, 50, 100]).peak_ratio == 2.0


def test_soft_obstacles_are_those_of_5_kn_m_at_most():
    stiffness = (5e3, 5001.0, 1e6)
    mine = [trial("safe", i, 10.0, stiffness=k) for i, k in enumerate(stiffness)]
    theirs = [trial("vices", i, peak) for i, peak in enumerate((40.0, 10.0, 10.0))]
    assert compare(mine, theirs).peak_ratio_soft == 4.0


def test_a_contact_that_ended_counts_as_half_a_newton():
    assert compare([trial("safe", 0, 10, 0.0)], [trial("vices", 0, 10, 20.0)]).steady_ratio == 40.0
    assert compare([trial("safe", 0, 10, 0.1)], [trial("vices", 0, 10, 0.0)]).steady_ratio == 1.0


def test_trials_in_which_nothing_was_touched_are_left_out_and_counted():
    mine = [trial("safe", 0, 0.0, met=0.0), trial("safe", 1, 0.0, met=0.0), trial("safe", 2, 30.0)]
    theirs = [trial("vices", 2, 60.0), trial("vices", 1, 50.0), trial("vices", 0, 0.2, met=0.0)]
    verdict = compare(mine, theirs)
    assert (verdict.compared, verdict.left_out, verdict.met) == (2, 1, 0.5)
    assert verdict.peak_ratio == pytest.approx((2.0 + 100.0) / 2)


def test_time_to_report_is_of_the_contacts_that_were_reported():
    mine = [trial("safe", i, 10, detect=detect) for i, detect in enumerate((NAN, 10.0, 20.0, 30.0))]
    verdict = compare(mine, [trial("vices", i, 10) for i in range(4)])
    assert (verdict.reported, verdict.detect_median_ms) == (0.75, 20.0)
    assert verdict.detect_p95_ms == pytest.approx(29.0)


def test_switches_and_joint_limits_of_the_trials():
    mine = [trial("safe", i, 10, mode_switches=2.0 * i, limit_touches=float(i == 1)) for i in range(4)]
    verdict = compare(mine, [trial("vices", i, 10) for i in range(4)])
    assert (verdict.switches_max, verdict.at_limits) == (6.0, 0.25)


def test_nothing_touched_at_all_has_no_figures():
    verdict = compare([trial("safe", 0, 0.0, met=0.0)], [trial("vices", 0, 0.0, met=0.0)])
    assert astuple(verdict)[:3] == (0, 1, 0)
    assert all(math.isnan(value) for value in astuple(verdict)[3:])


def test_table_has_a_column_a_controller_and_plant():
    trials = [trial(name, 0, 10.0, plant=plant) for name in ("vices", "safe") for plant in ("real", "clean")]
    table = verdict_table(trials)
    assert table.columns[2:] == ("vices, real", "vices, clean", "safe, real", "safe, clean")
    records = {row["figure"]: row for row in table.as_records()}
    assert records["trials compared"]["safe, clean"] == 1
    assert records["trials in which the obstacle was touched"]["safe, real"] == 100.0
    assert "0.5 N" in table.note


def test_without_vices_the_first_controller_is_the_baseline():
    table = verdict_table([trial("mine", 0, 10.0), trial("yours", 0, 20.0)])
    assert {row["figure"]: row for row in table.as_records()}["peak regressions against mine"]["yours, real"] == 1


def test_worst_trials_lead_by_newtons_above_the_baseline_each_seed_once():
    trials = [trial("vices", seed, 50.0, plant=plant) for seed in range(15) for plant in ("real", "clean")]
    trials += [trial("safe", seed, 10.0 + 5 * seed, plant="real") for seed in range(15)]
    trials += [trial("safe", seed, 11.0 + 5 * seed, plant="clean") for seed in range(15)]
    (table,) = worst_tables(trials, "again {seed}")
    rows = table.as_records()
    assert table.name == "worst_safe"
    assert [row["seed"] for row in rows] == list(range(14, 14 - WORST, -1))
    assert rows[0]["scene"] == "sweep in free air, clean plant"
    assert (rows[0]["peak (N), safe"], rows[0]["peak (N), vices"], rows[0]["replay"]) == (81.0, 50.0, "again 14")


def test_sweeps_are_told_apart_from_holds():
    """A hold is bumped into: what is pressed then is mostly the impact, whatever the controller."""
    mine = [
        trial("safe", 0, 10.0, 2.0),
        trial("safe", 1, 30.0, 3.0, speed_m_s=0.0),
        trial("safe", 2, 30.0, speed_m_s=0.0),
    ]
    theirs = [trial("vices", 0, 40.0, 8.0), trial("vices", 1, 30.0, 3.0), trial("vices", 2, 30.0)]
    verdict = compare(mine, theirs)
    assert (verdict.peak_ratio, verdict.peak_ratio_sweeps, verdict.steady_ratio_sweeps) == (1.0, 4.0, 4.0)
