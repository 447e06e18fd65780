"""Metrics filled in: what is declared is shown, in its order, and nothing else."""

import pytest

from contactsafe.report import data
from contactsafe.report.rows import groups, highlights, lines, shortfalls
from contactsafe.results.experiment import Experiment, Trial
from contactsafe.results.metrics import Aim, Highlight, Metric

FORCE = Metric("force_n", "force", "N", main=True, aim=Aim(at_most=10.0, ratio_at_most=1 / 2))
DONE = Metric("done", "done, mean", "%", 100.0, mean=True)


def experiment(metrics, scenarios=("bottle",), **more):
    trials = tuple(
        Trial(scenario, name, seed, {"force_n": force + seed, "done": float(seed > 0), "else": 1.0})
        for scenario in scenarios
        for name, force in (("vices", 40.0), ("safe", 12.0))
        for seed in range(3)
    )
    return Experiment("x", "X", "?", trials, metrics, **more)


def test_what_is_declared_is_shown_in_its_order():
    assert [line.metric.name for line in lines(experiment((DONE, FORCE)))] == ["done", "force_n"]
    assert [line.metric.name for line in lines(experiment((DONE, FORCE)), main_only=True)] == ["force_n"]
    assert lines(experiment(())) == []


def test_a_declared_metric_that_no_trial_has_is_left_out():
    assert lines(experiment((Metric("other", "other"),))) == []


def test_the_middle_is_the_mean_where_the_metric_says_so():
    done, force = lines(experiment((DONE, FORCE)))
    assert done.values["safe"].middle == pytest.approx(2 / 3)
    assert force.values["safe"].middle == 13.0


def test_one_figure_in_many_scenarios_heads_them():
    (heading, labelled), *others = groups(experiment((FORCE,), ("bottle", "meter")))
    assert others == []
    assert heading == "force"
    assert [label for label, _ in labelled] == ["bottle", "meter"]
    assert [heading for heading, _ in groups(experiment((FORCE, DONE), ("bottle", "meter")))] == ["bottle", "meter"]


def test_misses_are_told_with_their_figures():
    found = experiment((FORCE,))
    assert lines(found)[0].reaches("safe") is False
    assert shortfalls(found, "safe") == [
        "bottle: force is 13.0 N, 0.32 of the 41.0 N of vices; the aim is under 10 N at most 1/2 of vices."
    ]
    assert shortfalls(experiment((DONE,)), "safe") == []


def test_highlights_are_labelled_and_those_without_a_figure_left_out():
    shown = (Highlight("bottle", "force_n", "Force on it"), Highlight("meter", "force_n", "Not measured"))
    ((label, line),) = highlights([experiment((FORCE,), highlights=shown)])
    assert label == "Force on it"
    assert line.values["vices"].middle == 41.0


@pytest.mark.parametrize(
    ("value", "text"), [(0.123, "0.12"), (12.34, "12.3"), (123.4, "123"), (-0.5, "−0.50"), (float("nan"), "–")]
)
def test_numbers_have_about_three_digits(value, text):
    assert data.number(value) == text


def test_known_controllers_come_first_and_keep_their_colours():
    trials = tuple(Trial("s", name, 0, {"force_n": 1.0}) for name in ("mine", "safe", "vices"))
    names = data.controllers([Experiment("x", "X", "?", trials)])
    assert names == ["vices", "safe", "mine"]
    chosen = data.colours(names)
    assert chosen["safe"] == data.COLOURS["safe"]
    assert len(set(chosen.values())) == 3
    assert data.css_variable("my own") == "--c-my-own"
