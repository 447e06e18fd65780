"""What tests compare of observations, whatever a task observes."""

import numpy as np

MEASURED = ("force", "torque")
"""What the wrist measures: its bias and noise come from a stream of the worlds', not of the episode's."""


def same(a, b):
    """Whether two observations are equal."""
    return all(np.array_equal(a[key], b[key]) for key in a)


def row(observation, i):
    """One environment's part of a batch."""
    return {key: value[i] for key, value in observation.items()}


def drawn(observation):
    """What an episode's generator decides of its first observation."""
    return {key: value for key, value in observation.items() if key not in MEASURED}
