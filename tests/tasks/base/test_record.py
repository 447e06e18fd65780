"""What tasks share of a step's record: the price of force was a law of each task's own."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.sim.truth import step_metrics_dtype
from contactsafe.tasks.base.record import force_excess


def excess(force, gentle):
    metrics = np.zeros(1, dtype=step_metrics_dtype)
    metrics["tool_force_peak"] = force
    return force_excess(metrics[0], gentle)


@given(st.floats(0.0, 1e4), st.floats(0.1, 100.0))
def test_nothing_up_to_the_gentle_force_and_four_at_most(force, gentle):
    found = excess(force, gentle)
    assert 0.0 <= found <= 4.0
    assert (found == 0.0) == (force / gentle <= 1.0)


def test_one_at_twice_the_gentle_force():
    assert excess(14.0, 7.0) == pytest.approx(1.0)
    assert excess(35.0, 7.0) == pytest.approx(4.0)


@given(st.floats(0.1, 1e3), st.floats(0.0, 1e3), st.floats(0.1, 100.0))
def test_more_force_never_costs_less(force, more, gentle):
    assert excess(force + more, gentle) >= excess(force, gentle)
