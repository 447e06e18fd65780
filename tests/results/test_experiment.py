"""Spreads over seeds and strict JSON."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.results.experiment import Experiment, Table, Trial, to_json
from contactsafe.results.metrics import Highlight, Metric
from contactsafe.results.spread import spread

NAN = float("nan")


def experiment():
    trials = [
        Trial(scenario, controller, seed, {"force_n": value, "time_s": NAN})
        for scenario, controller, values in (("bottle", "vices", (4.0, 1.0, 2.0)), ("bottle", "safe", (1.0, NAN, 3.0)))
        for seed, value in enumerate(values)
    ]
    return Experiment("joint-safety", "Joint safety", "Which forces?", tuple(trials))


def test_a_spread_is_the_quantiles_of_the_values():
    values = np.random.default_rng(0).normal(size=101)
    found = spread(list(values))
    ordered = np.sort(values)
    assert (found.median, found.p5, found.p95) == pytest.approx((ordered[50], ordered[5], ordered[95]))
    assert (found.min, found.max, found.n) == (ordered[0], ordered[-1], 101)


def test_figures_that_do_not_exist_are_left_out_and_counted():
    found = spread([NAN, 1.0, 3.0, math.inf])
    assert (found.median, found.min, found.max, found.n) == (2.0, 1.0, 3.0, 2)
    empty = spread([NAN])
    assert empty.n == 0
    assert all(math.isnan(value) for value in (empty.median, empty.p5, empty.p95, empty.min, empty.max))


def test_spreads_gather_by_scenario_controller_and_metric():
    spreads = experiment().spreads()
    assert spreads["bottle"]["vices"]["force_n"].median == 2.0
    assert spreads["bottle"]["safe"]["force_n"].n == 2
    assert spreads["bottle"]["safe"]["time_s"].n == 0


def test_plants_are_gathered_apart():
    trials = tuple(
        Trial("hold", "safe", 0, {"force_n": force}, plant) for plant, force in (("real", 2.0), ("clean", 1.0))
    )
    spreads = Experiment("collisions", "Collisions", "Which forces?", trials).spreads()
    assert list(spreads) == ["hold, real plant", "hold, clean plant"]
    assert spreads["hold, clean plant"]["safe"]["force_n"].median == 1.0


def test_tables_are_records_in_json():
    table = Table("worst", "The worst", ("seed", "peak (N)"), ((3, 4.5), (7, NAN)), "Look at them.")
    written = Experiment("collisions", "Collisions", "Which forces?", tables=(table,)).as_dict()
    assert written["tables"] == {"worst": [{"seed": 3, "peak (N)": 4.5}, {"seed": 7, "peak (N)": None}]}


def test_json_is_strict_and_says_null_where_nothing_is():
    text = to_json(experiment().as_dict())
    assert not {"NaN", "Infinity"} & set(text.replace(",", " ").split())
    read = json.loads(text, parse_constant=pytest.fail)
    assert read["spread"]["bottle"]["safe"]["time_s"] == {
        "median": None, "mean": None, "p5": None, "p95": None, "min": None, "max": None, "n": 0,
    }  # fmt: skip
    assert read["trials"][4] == {
        "scenario": "bottle", "controller": "safe", "seed": 1, "plant": "",
        "metrics": {"force_n": None, "time_s": None},
    }  # fmt: skip


def test_evaluation_of_a_policy_that_cleaned_nothing_is_still_json():
    """`evaluate --json` ended in a traceback: the time to a clean board was NaN."""
    text = to_json({"time_s": NAN, "boards": [{"time_s": NAN, "push_s": (0.5, math.inf)}]})
    assert json.loads(text, parse_constant=pytest.fail) == {
        "time_s": None, "boards": [{"time_s": None, "push_s": [0.5, None]}],
    }  # fmt: skip


scenarios = st.sampled_from(["bottle", "thrust meter"])
trials = st.lists(
    st.builds(
        Trial,
        scenario=scenarios,
        controller=st.sampled_from(["vices", "safe"]),
        seed=st.integers(0, 9),
        metrics=st.fixed_dictionaries({"force_n": st.floats(0, 100), "time_s": st.just(NAN)}),
        plant=st.sampled_from(["", "real", "clean"]),
    ),
    max_size=30,
)


@given(trials)
def test_every_trial_is_in_one_spread(found):
    spreads = Experiment("x", "X", "?", tuple(found)).spreads()
    counted = sum(row["force_n"].n for rows in spreads.values() for row in rows.values())
    assert counted == len(found)
    assert set(spreads) == {trial.heading for trial in found}
    assert all(row["time_s"].n == 0 for rows in spreads.values() for row in rows.values())


@given(trials)
def test_an_experiment_is_strict_json_whatever_it_measured(found):
    read = json.loads(to_json(Experiment("x", "X", "?", tuple(found)).as_dict()), parse_constant=pytest.fail)
    assert len(read["trials"]) == len(found)


@pytest.mark.parametrize(("plant", "heading"), [("", "bottle"), ("real", "bottle, real plant")])
def test_a_plant_is_part_of_the_heading(plant, heading):
    assert Trial("bottle", "safe", 0, {}, plant).heading == heading


def test_declarations_go_along():
    metric = Metric("force_n", "force", "N", main=True)
    written = Experiment("x", "The x", "Why?", (), (metric,), (Highlight("bottle", "force_n", "Force"),)).as_dict()
    assert (written["title"], written["question"]) == ("The x", "Why?")
    assert written["metrics"] == {"force_n": metric.as_dict()}
    assert written["highlights"] == [{"scenario": "bottle", "metric": "force_n", "label": "Force"}]


@given(st.floats(-1e6, 1e6))
def test_numbers_keep_six_digits(value):
    assert json.loads(to_json({"value": value}))["value"] == pytest.approx(value, rel=1e-5, abs=1e-300)
