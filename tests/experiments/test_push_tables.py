"""Tables of pushes from trials made up for the purpose."""

import math

import pytest

from contactsafe.experiments.push_tables import AWAY_MM, WORST, push_tables
from contactsafe.experiments.pushes import WITH_WRENCH, WITHOUT, compared
from contactsafe.results.experiment import Trial


def trial(controller, seed, mm, scenario=WITH_WRENCH, **more):
    metrics = {
        "tool_displacement_mm": mm,
        "tool_off_path_mm": 0.8 * mm,
        "tool_displacement_after_mm": 0.5 * mm,
        "tool_error_end_mm": 0.1 * mm,
        "joint_speed_peak_rad_s": 0.2,
        "report_ms": math.nan,
        "reject_ms": math.nan,
        "never_rejected": 1.0,
        "reported_early": 0.0,
        "link": 5.0,
        "ramp_ms": 100.0,
        "angle_deg": 0.0,
        "moves": 0.0,
        "force_n": 20.0,
        "stiffness_1_s2": 150.0,
    }
    return Trial(scenario, controller, seed, metrics | more)


def tables(mine, theirs, **more):
    """Compare displacements with the baseline's, seed by seed."""
    trials = [trial("vices", i, mm, **more) for i, mm in enumerate(theirs)]
    trials += [trial("safe", i, mm, **more) for i, mm in enumerate(mine)]
    return {table.name: table for table in push_tables(compared(trials, "vices"), "vices", "again {seed}")}


def figures(table, column="safe, with wrench"):
    return {row["figure"]: row[column] for row in table.as_records()}


def test_verdict_sums_up_displacements_and_ratios():
    found = figures(tables([2.0, 4.0, 60.0], [10.0, 10.0, 40.0])["verdict"])
    assert found["trials"] == 3
    assert found["worse than vices"] == 1
    assert found["displacement, median"] == 4.0
    assert found["displacement, largest"] == 60.0
    assert found["controller / vices, median"] == pytest.approx(0.4)
    assert found["2 s after release, largest"] == pytest.approx(6.0)


def test_contacts_reported_before_the_push_are_counted_beside_those_never_named():
    found = figures(tables([2.0, 4.0], [10.0, 10.0], reported_early=1.0, never_rejected=0.0)["verdict"])
    assert found["reported before the onset"] == 2
    assert found["never named a push"] == 0


def test_the_baseline_against_itself_is_never_worse():
    found = figures(tables([2.0, 4.0], [10.0, 90.0])["verdict"], "vices, with wrench")
    assert found["worse than vices"] == 0
    assert found["controller / vices, median"] == 1.0


def test_a_tool_that_does_not_come_back_is_counted():
    found = figures(tables([9.9 * AWAY_MM, 10.1 * AWAY_MM], [500.0, 500.0])["verdict"])
    assert found[f"more than {AWAY_MM:g} mm away by then"] == 1


def test_holding_and_moving_have_ratios_of_their_own():
    trials = [trial("vices", seed, 10.0, moves=float(seed)) for seed in (0, 1)]
    trials += [trial("safe", 0, 2.0, moves=0.0), trial("safe", 1, 30.0, moves=1.0)]
    verdict, _, worst = push_tables(compared(trials, "vices"), "vices", "again {seed}")
    found = figures(verdict)
    assert found["the same, the tool holds"] == pytest.approx(0.2)
    assert found["the same, the tool moves"] == pytest.approx(3.0)
    assert (found["worse than vices"], found["of those the tool held"]) == (1, 0)
    assert worst.as_records()[0]["tool"] == "moves"


def test_what_was_never_reported_has_no_time_and_is_counted():
    trials = [trial("vices", 0, 5.0), trial("vices", 1, 5.0)]
    trials += [trial("safe", 0, 5.0, reject_ms=80.0, report_ms=20.0, never_rejected=0.0), trial("safe", 1, 5.0)]
    verdict, _ = push_tables(compared(trials, "vices"), "vices", "again {seed}")
    found = figures(verdict)
    assert (found["onset to report, median"], found["onset to 'push', median"]) == (20.0, 80.0)
    assert found["never named a push"] == 1
    assert math.isnan(figures(verdict, "vices, with wrench")["onset to report, median"])


def test_kinds_split_the_trials_by_link_ramp_direction_and_motion():
    trials = [
        trial("vices", 0, 5.0, link=3.0, ramp_ms=30.0),
        trial("vices", 1, 7.0, link=6.0, ramp_ms=1000.0, angle_deg=90.0, moves=1.0),
        trial("vices", 2, 9.0, link=6.0, ramp_ms=150.0, angle_deg=33.0),
    ]
    _, kinds = push_tables(compared(trials, "vices"), "vices", "again {seed}")
    found = {row["push"]: row["trials"] for row in kinds.as_records()}
    assert (found["link 3"], found["link 6"]) == (1, 2)
    assert [found[name] for name in found if name.startswith("ramp")] == [1, 0, 1, 1]
    assert (found["along the normal"], found["oblique"], found["sideways"]) == (1, 1, 1)
    assert (found["tool holds"], found["tool moves"]) == (2, 1)
    of_link_6 = next(row for row in kinds.as_records() if row["push"] == "link 6")
    assert of_link_6["vices, with wrench"] == "8.0  8.9  0"


def test_kinds_without_a_trial_are_shown_as_such():
    _, kinds = push_tables(compared([trial("vices", 0, 5.0)], "vices"), "vices", "again {seed}")
    assert next(row for row in kinds.as_records() if row["push"] == "sideways")["vices, with wrench"] == "-"


def test_worst_trials_lead_by_millimetres_and_say_how_to_run_them_again():
    mine, theirs = [20.0 + seed for seed in range(15)], [1.0] * 15
    worst = tables(mine, theirs)["worst_safe, with wrench"].as_records()
    assert [row["seed"] for row in worst] == list(range(14, 14 - WORST, -1))
    assert (worst[0]["mm"], worst[0]["mm, vices"]) == (34.0, pytest.approx(1.0))
    assert worst[0]["replay"] == "again 14"


def test_no_table_of_worst_trials_where_none_is_worse():
    assert set(tables([1.0], [2.0])) == {"verdict", "kinds"}


def test_scenarios_have_columns_of_their_own():
    trials = [trial(name, 0, 5.0, scenario) for scenario in (WITH_WRENCH, WITHOUT) for name in ("vices", "safe")]
    verdict, _ = push_tables(compared(trials, "vices"), "vices", "again {seed}")
    assert verdict.columns[2:] == (
        "vices, with wrench",
        "safe, with wrench",
        "vices, without wrench",
        "safe, without wrench",
    )
