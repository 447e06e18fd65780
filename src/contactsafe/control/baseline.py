"""Baseline: what the residual shows about a posture while nothing touches the arm, so that a change of it shows early.

Weight that nobody told of, a sensor's bias and friction at rest stay as they are while the arm stays where it is. What
was learned counts for less the further the arm has gone from where it was learned.
"""

import math

import numpy as np

from contactsafe.control.laws import filter_gain
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled, inlined

_f = np.float64

_MEMORY_1_S = 0.5
"""It is learned within 2 s. Of a push that comes up more slowly a part is taken for baseline, until it is found."""

_LEARNED_S = 0.25

_ELSEWHERE_RAD = 0.2
"""So far from where it was learned a baseline says nothing any more."""


def baseline_dtype(n: int) -> np.dtype:
    """Describe what is remembered of the residual while nothing touched."""
    return np.dtype(
        [
            ("residual", _f, (n,)),  # N m
            ("q", _f, (n,)),  # posture that it goes with, rad
            ("seconds", _f),  # for which it was learned
            ("weight", _f),  # of it here and now, 0 … 1
        ]
    )


@inlined
def follow_baseline(baseline: Record, residual: Vector, q: Vector, untouched: bool, dt: float) -> None:
    """Learn the residual while nothing touches, and tell how much of it holds for the posture of now.

    Args:
        baseline: `baseline_dtype` record; advanced.
        residual: (n,), N m.
        q: (n,), rad.
        untouched: whether nothing touches arm or tool.
        dt: that passed, s.
    """
    if untouched:
        baseline.seconds += dt
        gain = max(filter_gain(_MEMORY_1_S, dt), dt / baseline.seconds)
        for i in range(q.shape[0]):
            baseline.residual[i] += gain * (residual[i] - baseline.residual[i])
            baseline.q[i] += gain * (q[i] - baseline.q[i])
    known = min(baseline.seconds / _LEARNED_S, 1.0)
    baseline.weight = known * max(1.0 - distance(q, baseline.q) / _ELSEWHERE_RAD, 0.0)


@compiled
def distance(a: Vector, b: Vector) -> float:
    """Return how far two postures are from each other, rad."""
    squared = 0.0
    for i in range(a.shape[0]):
        squared += (a[i] - b[i]) ** 2
    return math.sqrt(squared)
