"""How readily an arm's tool is moved, as one number of the arm: what a singularity is measured against."""

import functools
from typing import NamedTuple

import numpy as np

from contactsafe.robot.arm import Arm, finite_range
from contactsafe.robot.dynamics import dynamics_dtype, update_dynamics

_POSTURES = 256


class Mobility(NamedTuple):
    """What the tool's mobility J M⁻¹ Jᵀ is at best, over random postures of an arm.

    Attributes:
        directions: in which the tool can be moved, 6 but for arms of fewer joints or of parallel ones.
        mean: geometric mean of the mobility along them, 1/kg and 1/(kg m²); det(J M⁻¹ Jᵀ) is its sixth power.
    """

    directions: int
    mean: float


@functools.lru_cache(maxsize=16)  # many controllers of one arm are built at once
def best_mobility(arm: Arm) -> Mobility:
    """Find the best mobility of an arm's tool within the joint range."""
    rng, nominal = np.random.default_rng(0), arm.nominal()
    q_min, q_max = finite_range(arm.q_min, arm.q_max)
    found, still = np.zeros(1, dtype=dynamics_dtype(arm.n))[0], np.zeros(arm.n)
    best = Mobility(0, 0.0)
    for q in rng.uniform(q_min, q_max, (_POSTURES, arm.n)):
        update_dynamics(nominal.handle, q, still, found)
        J = found["J"]
        directions = int(np.linalg.matrix_rank(J))
        along = np.linalg.eigvalsh(J @ found["M_inv"] @ J.T)[6 - directions :]
        best = max(best, Mobility(directions, float(np.prod(np.maximum(along, 0.0)) ** (1 / max(directions, 1)))))
    return best
