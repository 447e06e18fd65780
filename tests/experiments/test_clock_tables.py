"""The clock experiment's tables: the worst of all seeds, each case in the table it belongs to."""

import itertools

import numpy as np
import pytest

from contactsafe.experiments.clock_cases import CASES, SITUATIONS, heading
from contactsafe.experiments.clock_tables import clock_tables
from contactsafe.report import terminal_table
from contactsafe.results.experiment import Experiment, Trial

NAN = float("nan")
BRIDGED = next(case for case in CASES if not case.stops and case.silent_s == 0.0)
BRAKED = next(case for case in CASES if case.stops)


def metrics(case, seed, touched):
    led = not case.stops and case.silent_s == 0.0
    return {
        "false_contact_ms": NAN if touched else 0.0, "torque_step_nm": 0.1 * (seed + 1),
        "tool_away_mm": 1.0 + seed if led else NAN, "tool_travel_mm": NAN if led else 5.0 + seed,
        "contact_peak_n": 20.0 if touched else NAN, "contact_peak_calm_n": 19.0 if touched else NAN,
        "joint_speed_left_rad_s": 0.01, "fault": float(7 * case.stops), "torque_step_back_nm": 0.2,
    }  # fmt: skip


@pytest.fixture(scope="module")
def tables():
    cases = (BRIDGED, BRAKED)
    trials = [
        Trial(heading(case, timed, situation), "safe", seed, metrics(case, seed, situation == "in contact"))
        for case, timed, situation, seed in itertools.product(cases, (False, True), SITUATIONS, range(3))
    ]
    return clock_tables(trials, ("safe",), cases)


def test_there_is_one_of_what_is_bridged_and_one_of_what_is_braked(tables):
    assert [table.name for table in tables] == ["bridged_safe", "braked_safe"]
    assert [{row[0] for row in table.rows} for table in tables] == [{BRIDGED.name}, {BRAKED.name}]
    for table in tables:
        assert [row[1] for row in table.rows] == ["-", "given"]
        assert {len(row) for row in table.rows} == {len(table.columns)}


def test_entries_are_the_worst_of_all_seeds(tables):
    bridged, braked = (table.rows[0] for table in tables)
    assert bridged[2:4] == (0.0, pytest.approx(0.3))
    assert bridged[4:8] == (3.0,) * 4
    assert bridged[8:] == (20.0, 19.0)
    assert braked[4:8] == (7.0,) * 4
    assert braked[9] == "7"


def test_what_no_trial_has_is_no_number():
    trials = [
        Trial(heading(BRIDGED, timed, situation), "safe", 0, metrics(BRIDGED, 0, False))
        for timed, situation in itertools.product((False, True), SITUATIONS)
    ]
    (row, _) = clock_tables(trials, ("safe",), (BRIDGED,))[0].rows
    assert np.isnan(row[8])


def test_all_cases_fit_a_page_of_120_columns():
    trials = [
        Trial(heading(case, timed, situation), "safe", 0, metrics(case, 0, situation == "in contact"))
        for case, timed, situation in itertools.product(CASES, (False, True), SITUATIONS)
    ]
    tables = tuple(clock_tables(trials, ("safe",), CASES))
    printed = terminal_table([Experiment("clock", "Clocks", "", (), (), tables=tables)])
    assert max(map(len, printed.splitlines())) <= 120
    assert len(printed.splitlines()) > 2 * len(CASES)
