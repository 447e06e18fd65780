"""A contact made up at random: inertia, direction and a command."""

import numpy as np


def scene(seed, n=7):
    """Return inertia, its inverse, a unit direction and a command, all random."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(n, n))
    M = B @ B.T / n + 0.2 * np.eye(n)
    direction = rng.normal(size=n)
    return M, np.linalg.inv(M), direction / np.linalg.norm(direction), 20.0 * rng.normal(size=n)
