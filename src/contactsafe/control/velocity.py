"""Velocity: that of the robot's own signal, or the difference of its positions, whichever is quieter.

Two measurements of one velocity tell the noise of both: white noise σ_q of positions shows in their third difference,
which no motion of an arm does within a tick, and what else they differ by is the robot's.
"""

import numpy as np

from contactsafe.control.laws import filter_gain
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled, inlined

_f = np.float64
_i = np.int64

VELOCITY_SOURCES = ("robot", "positions", "quieter")
"""What `velocity_source` may be."""

_ROBOT, _POSITIONS, _QUIETER_OF_TWO = 0, 1, 2

_BAND_1_S = 300.0
"""Noise is compared below 50 Hz: what is faster the observer filters anyway."""

_MEMORY_TICKS = 1000.0

_IN_TIME = (0.3, 2.5)
"""Ticks between two measurements that are compared."""

_LEAST_TICKS = 20.0
"""After so many both are compared first."""

_QUIETER = 0.5
"""A source takes over where its variance is less than this fraction of the other's."""


def velocity_dtype(n: int) -> np.dtype:
    """Describe what is remembered of two velocities."""
    return np.dtype(
        [
            ("qd", _f, (n,)),  # in force, rad/s
            ("source", _i, (n,)),  # of it, place in `VELOCITY_SOURCES`
            ("q_before", _f, (n,)),  # rad
            ("qd_before", _f, (n,)),  # of the robot, rad/s
            ("difference", _f, (n, 2)),  # of positions, the last one in a tick, and its change, rad
            ("apart", _f, (n,)),  # the robot's less that of positions, below 50 Hz, rad/s
            ("apart_variance", _f, (n,)),  # rad²/s²
            ("third_variance", _f, (n,)),  # of the third difference, rad²
            ("ticks", _f),  # in a row that were measured in time
        ]
    )


@compiled
def start_velocity(velocity: Record, q: Vector, qd: Vector) -> None:
    """Begin with the robot's signal."""
    velocity.qd[:], velocity.q_before[:], velocity.qd_before[:] = qd, q, qd
    velocity.ticks = 0.0


@inlined
def follow_velocities(velocity: Record, arm: Record, since: float, dt: float, untouched: bool, choice: int) -> None:
    """Take a measurement over and choose the velocity in force of each joint.

    Args:
        velocity, arm: records; the former is advanced.
        since, dt: ticks that passed since the last measurement, and how long one is, s.
        untouched: whether nothing touches the arm; else nothing is learned of the noise.
        choice: place in `VELOCITY_SOURCES`.
    """
    if choice == _ROBOT:
        velocity.qd[:] = arm.qd
        return
    in_time = _IN_TIME[0] < since < _IN_TIME[1]
    velocity.ticks = velocity.ticks + 1.0 if in_time else 0.0
    learning, band = in_time and untouched and velocity.ticks > 3.0, filter_gain(_BAND_1_S, dt)
    for i in range(arm.q.shape[0]):
        by_positions = (arm.q[i] - velocity.q_before[i]) / (since * dt)
        apart = 0.5 * (arm.qd[i] + velocity.qd_before[i]) - by_positions
        _compare(velocity, i, by_positions * dt, apart, band, learning)
        if choice != _QUIETER_OF_TWO:
            velocity.source[i] = choice
        elif velocity.ticks > _LEAST_TICKS:
            velocity.source[i] = _quieter(velocity, i, band, dt)
        velocity.qd[i] = by_positions if velocity.source[i] == _POSITIONS else arm.qd[i]
    velocity.q_before[:], velocity.qd_before[:] = arm.q, arm.qd


@inlined
def _compare(velocity: Record, i: int, moved: float, apart: float, band: float, learning: bool) -> None:
    """Follow joint i's third difference of positions, and what its two velocities differ by."""
    velocity.apart[i] += band * (apart - velocity.apart[i])
    third = _third_difference(velocity.difference[i], moved)
    if learning:
        gain = 1.0 / min(max(velocity.ticks - 3.0, 1.0), _MEMORY_TICKS)
        velocity.apart_variance[i] += gain * (velocity.apart[i] * velocity.apart[i] - velocity.apart_variance[i])
        velocity.third_variance[i] += gain * (third * third - velocity.third_variance[i])


@inlined
def _third_difference(difference: Vector, first: float) -> float:
    second = first - difference[0]
    third = second - difference[1]
    difference[0], difference[1] = first, second
    return third


@inlined
def _quieter(velocity: Record, i: int, band: float, dt: float) -> int:
    """Return the source whose noise below 50 Hz is less; the one in force where they hardly differ.

    White noise of positions has a third difference of variance 20 σ_q²; as a velocity behind a first-order filter that
    takes up a fraction a, it has 2 a² / (2 − a) σ_q² / dt².
    """
    of_positions = 2.0 * band * band / (2.0 - band) * velocity.third_variance[i] / (20.0 * dt * dt)
    of_robot = max(velocity.apart_variance[i] - of_positions, 0.0)
    if of_positions < _QUIETER * of_robot:
        return _POSITIONS
    return _ROBOT if of_robot <= _QUIETER * of_positions else int(velocity.source[i])
