"""What the plots are made of: spans of contact."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from contactsafe.report.plots import spans

TICK = 0.001


@given(st.lists(st.booleans(), min_size=1, max_size=300))
def test_spans_cover_what_is_so_and_no_gap_that_can_be_seen(so):
    times, active = TICK * np.arange(len(so)), np.array(so)
    found = spans(times, active, gap_s=5 * TICK)
    within = [any(start <= time <= stop for start, stop in found) for time in times]
    assert all(np.array(within)[active])
    for start, stop in found:
        ticks = np.flatnonzero(active & (times >= start) & (times <= stop))
        assert (times[ticks[0]], times[ticks[-1]]) == (start, stop)
        assert all(np.diff(ticks) <= 6)
    assert all(later[0] - earlier[1] > 5 * TICK for earlier, later in zip(found, found[1:], strict=False))
