"""Policy steps take whole ticks, and keep to their rate over any length of time."""

import numpy as np

from contactsafe.policy.rate import POLICY_RATE_HZ, ticks_of_step
from contactsafe.sim.worlds import MAX_TICKS, TICK_S


def test_steps_keep_to_the_rate_forever():
    ticks = ticks_of_step(np.arange(100_000))
    behind = np.cumsum(ticks) * TICK_S - np.arange(1, len(ticks) + 1) / POLICY_RATE_HZ
    assert behind.min() > -1e-9
    assert behind.max() < TICK_S


def test_no_step_is_longer_than_worlds_can_run():
    assert np.unique(ticks_of_step(np.arange(100_000))).max() <= MAX_TICKS


def test_a_step_alone_takes_as_many_ticks_as_among_others():
    assert [ticks_of_step(k) for k in range(7)] == ticks_of_step(np.arange(7)).tolist() == [17, 17, 16, 17, 17, 16, 17]
