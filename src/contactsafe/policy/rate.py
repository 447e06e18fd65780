"""How often a policy acts, and how many ticks of the controller each of its steps lasts."""

from typing import TypeVar

import numpy as np

POLICY_RATE_HZ = 60
"""Rate of the policy, as in the paper; 1 kHz does not divide by it, so its steps last 17, 17 and 16 ticks in turn."""

_TICKS_PER_S = 1000

Steps = TypeVar("Steps", int, np.ndarray)


def ticks_of_step(step: Steps) -> Steps:
    """Return the number of 1 kHz ticks of the policy steps with these numbers, counted from 0."""
    return _ticks_before(step + 1) - _ticks_before(step)


def _ticks_before(step: Steps) -> Steps:
    return -(-step * _TICKS_PER_S // POLICY_RATE_HZ)
