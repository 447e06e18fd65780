"""What the plots are made of: spans of contact."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.report.plots import spans

TICK = 0.001


@given(st.lists(st.booleans(), min_size=1, max_size=300))
def test_spans_cover_what_is_so_and_no_gap_that_can_be_seen(so):
    times, active = TICK * np.arange(len(so)), np.array(so)
    found = spans(times, active, gap_s=4.5 * TICK)
    within = [any(start <= time <= stop for start, stop in found) for time in times]
    assert all(np.array(within)[active])
    for start, stop in found:
        ticks = np.flatnonzero(active & (times >= start) & (times <= stop))
        assert times[ticks[0]] == start
        assert times[min(ticks[-1] + 1, len(times) - 1)] == stop
        assert all(np.diff(ticks) <= 5)
    assert all(later[0] - earlier[1] > 4.5 * TICK for earlier, later in itertools.pairwise(found))


def test_a_knock_of_one_tick_is_seen():
    assert spans(TICK * np.arange(4), np.array([False, True, False, False])) == [(TICK, 2 * TICK)]
