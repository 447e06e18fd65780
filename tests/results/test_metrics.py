"""Aims: what they say, and when they are reached."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.results.metrics import ZERO, Aim, Metric, ratio
from contactsafe.results.spread import Spread, spread

figures = st.floats(0.01, 1000.0)


def of(*values):
    return spread(values)


@pytest.mark.parametrize(
    ("aim", "text"),
    [
        (Aim(at_most=10.0), "under 10 N"),
        (Aim(at_most=40.0, always=True), "always under 40 N"),
        (Aim(at_least=95.0), "over 95 N"),
        (Aim(at_most=10.0, at_least=2.0), "2 to 10 N"),
        (ZERO, "always 0"),
        (Aim(ratio_at_most=1 / 3), "at most 1/3 of vices"),
        (Aim(at_least=80.0, ratio_at_least=0.95), "over 80 N at least 0.95 of vices"),
        (Aim(at_most=5.0, where_baseline_above=8.0), "under 5 N where vices passes 8"),
    ],
)
def test_aims_say_what_they_ask(aim, text):
    assert aim.text("N") == text


@given(figures, figures)
def test_bounds_hold_at_their_own_value(value, bound):
    assert Aim(at_most=bound).is_reached(of(value), None, 1.0) == (value <= bound)
    assert Aim(at_least=bound).is_reached(of(value), None, 1.0) == (value >= bound)


@given(figures, figures, st.floats(0.1, 100.0))
def test_bounds_are_in_the_shown_unit(value, bound, scale):
    assert Aim(at_most=bound).is_reached(of(value), None, scale) == (scale * value <= bound)


@given(st.lists(figures, min_size=2, max_size=20), figures)
def test_always_is_compared_with_the_largest(values, bound):
    assert Aim(at_most=bound, always=True).is_reached(of(*values), None, 1.0) == (max(values) <= bound)


@given(figures, figures)
def test_ratios_do_not_depend_on_the_unit(value, baseline):
    aim = Aim(ratio_at_most=0.5)
    assert aim.is_reached(of(value), of(baseline), 1.0) == aim.is_reached(of(value), of(baseline), 100.0)
    assert ratio(of(value), of(baseline)) == pytest.approx(value / baseline)


@pytest.mark.parametrize(
    ("aim", "value", "baseline"),
    [
        (Aim(at_most=1.0), None, None),
        (Aim(at_most=1.0), of(math.nan), None),
        (Aim(ratio_at_most=1.0), of(1.0), None),
        (Aim(ratio_at_most=1.0), of(1.0), of(0.0)),
        (Aim(at_most=1.0, where_baseline_above=8.0), of(1.0), of(7.0)),
        (Aim(at_most=1.0, where_baseline_above=8.0), of(1.0), None),
    ],
)
def test_what_cannot_be_said_is_not_compared(aim, value, baseline):
    assert aim.is_reached(value, baseline, 1.0) is None


def test_the_mean_is_compared_where_the_metric_says_so():
    value = of(0.0, 1.0, 1.0)
    aim = Aim(at_least=0.9)
    assert aim.is_reached(value, None, 1.0)
    assert not aim.is_reached(value.centred_on_mean(), None, 1.0)
    assert value.centred_on_mean().middle == pytest.approx(2 / 3)


def test_a_metric_as_plain_values():
    metric = Metric("clean", "clean, mean", "%", 100.0, aim=Aim(at_least=95.0), mean=True)
    assert metric.as_dict() == {
        "label": "clean, mean", "unit": "%", "scale": 100.0, "middle": "mean", "aim": "over 95 %",
    }  # fmt: skip
    assert replace(metric, mean=False, aim=None).as_dict()["aim"] == ""


@given(st.lists(figures, min_size=1, max_size=40))
def test_statistics_are_in_order(values):
    found = spread(values)
    assert isinstance(found, Spread)
    assert found.min <= found.p5 <= found.median <= found.p95 <= found.max
    assert found.min - 1e-9 <= found.mean <= found.max + 1e-9
    assert set(found.as_dict()) == {"median", "mean", "p5", "p95", "min", "max", "n"}
