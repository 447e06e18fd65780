"""Work: what a contact has done on the arm. A passive thing gives back no more than it took; who pushes does.

An arm that runs into something does work on it, an arm that is pushed has work done on it, so the sign of the work
tells a push from an obstacle before the arm has given in: the passivity of the environment (Hogan 1985).
"""

import math

import numpy as np

from contactsafe.control.codes import COMPLY, FREE, REJECT
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled, inlined

_f = np.float64

_MEMORY_S, _MEMORY_RAD = 0.5, 0.03
"""Work is forgotten within such a time and, while nothing touches, within such a motion: it is no contact's."""

_GIVEN_J, _CREDIT_J = 0.002, 0.01
"""What errors of the torque may feign; and the most that is remembered of what was given: a push is over at once."""

_SIGMAS = 2.0
"""Standard deviations by which the work may be wrong."""


def contact_work_dtype(n: int) -> np.dtype:
    """Describe what is remembered of the work between the arm and what touches it."""
    return np.dtype(
        [
            ("done_j", _f),  # by the contact on the arm
            ("moved_rad", _f, (n,)),  # by which each joint moved meanwhile
            ("doubt_j", _f),  # by which the model's errors in motion may have made it wrong
            ("taken_j", _f),  # by the contact from the arm, at most; negative where it has given more than it took
        ]
    )


@inlined
def follow_work(
    work: Record, touch: Record, model: Vector, velocity: Vector, mode: int, stored_j: float, dt: float
) -> None:
    """Add the work of one tick, and forget what no contact can still give back.

    Args:
        work: `contact_work_dtype` record; advanced.
        touch: `touch_dtype` record: torque of the contact on the arm, and its standard deviation.
        model: uncertainty of the arm's model in motion, (n,), N m.
        velocity: of the joints, in step with the torque, (n,), rad/s.
        mode, dt: in force, and the time that passed, s.
        stored_j: most that a passive thing can hold back at this torque.
    """
    speed, variance = 0.0, 0.0
    for i in range(velocity.shape[0]):
        work.done_j += dt * touch.torque[i] * velocity[i]
        work.doubt_j += dt * model[i] * abs(velocity[i])
        work.moved_rad[i] += dt * velocity[i]
        speed += velocity[i] * velocity[i]
    if mode == REJECT:  # one who pushes takes back what it gave as the arm comes back, and pushes on
        work.done_j = max(work.done_j, -_CREDIT_J)
    _forget(work, stored_j if mode == COMPLY else 0.0, dt / _MEMORY_S, dt * math.sqrt(speed) if mode == FREE else 0.0)
    for i in range(velocity.shape[0]):
        variance += (touch.sigma[i] * work.moved_rad[i]) ** 2
    work.taken_j = _SIGMAS * math.sqrt(variance) + work.doubt_j - work.done_j


@compiled
def _forget(work: Record, stored_j: float, time: float, moved: float) -> None:
    """Let the work go back to the nearest that a passive contact may still hold; `time` is a part of the memory's."""
    nearest = min(max(work.done_j, -stored_j), 0.0)
    if work.done_j == nearest:
        return
    keep = math.exp(-time - moved / _MEMORY_RAD)
    work.doubt_j *= keep
    work.done_j = min(nearest + keep * (work.done_j - nearest), _CREDIT_J + work.doubt_j)
    for i in range(work.moved_rad.shape[0]):
        work.moved_rad[i] *= keep


@compiled
def take_for_passive(work: Record, stored_j: float) -> None:
    """Forget what the contact has given: it has shown itself to be passive, and may hold back so much, J."""
    work.done_j = min(work.done_j, -stored_j)


@inlined
def is_active(work: Record) -> bool:
    """Tell whether the contact has given the arm more than it took: somebody pushes."""
    return work.taken_j < -_GIVEN_J


@compiled
def stored_at_most(torque: float, lever: float, stiffness: float) -> float:
    """Return what a spring of a stiffness in N/m holds at a torque in N m at a lever arm in m, τ² / (2 k l²), J."""
    force = torque / lever
    return 0.5 * force * force / stiffness
