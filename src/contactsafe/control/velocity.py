"""Velocity: that of the robot's own signal, or the difference of its positions, whichever is quieter.

Two measurements of one velocity tell the noise of both. White noise σ_q of positions shows in their third difference,
less what the robot's velocity says of the motion in it; by what else the two differ, the robot's signal is off.
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

_MEMORY_S = 1.0

_IN_TIME = (0.3, 2.5)
"""Ticks between two measurements that are compared."""

_LEAST_S, _LEAST_TICKS = 0.02, 10.0
"""After so long, and so many measurements, both are compared first."""

_NONE = 1e-9
"""A variance of noise that is none, rad²/s²."""

_RESUMED = 2.0
"""Measurements in time after a gap, from which on differences of positions are compared again."""

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
            ("apart_difference", _f, (n, 2)),  # the same of what positions differ by from the robot's velocity, rad
            ("apart", _f, (n,)),  # the robot's less that of positions, below 50 Hz, rad/s
            ("apart_variance", _f, (n,)),  # rad²/s²
            ("third_variance", _f, (n,)),  # of the third difference, rad²
            ("ticks", _f),  # in a row that were measured in time
            ("since_before", _f),  # ticks between the last two measurements
            ("between", _f),  # ticks between the middles of the last two gaps
            ("fresh", _i),  # 1 until the first measurement was taken
            ("changed", _i),  # whether those in force now and before are not to be compared
            ("of_positions", _i),  # whether any joint's is that of positions
        ]
    )


@compiled
def start_velocity(velocity: Record, q: Vector, qd: Vector) -> None:
    """Begin with the robot's signal."""
    velocity.qd[:], velocity.q_before[:], velocity.qd_before[:] = qd, q, qd
    velocity.ticks, velocity.since_before, velocity.between, velocity.fresh = 0.0, 1.0, 1.0, 1


@inlined
def follow_velocities(velocity: Record, arm: Record, since: float, dt: float, untouched: bool, choice: int) -> float:
    """Take a measurement over and choose the velocity in force of each joint.

    Args:
        velocity, arm: records; the former is advanced.
        since, dt: ticks that passed since the last measurement, and how long one is, s.
        untouched: whether nothing touches the arm; else nothing is learned of the noise.
        choice: place in `VELOCITY_SOURCES`.

    Returns:
        Ticks between the velocities in force now and before.
    """
    velocity.changed = 0
    if choice == _ROBOT or velocity.fresh != 0:
        velocity.qd[:], velocity.fresh = arm.qd, 0
        return since
    in_time = _IN_TIME[0] < since < _IN_TIME[1]
    velocity.ticks = velocity.ticks + 1.0 if in_time else 0.0
    learning, velocity.of_positions = in_time and untouched and velocity.ticks > 3.0, 0
    for i in range(arm.q.shape[0]):
        by_positions = (arm.q[i] - velocity.q_before[i]) / (since * dt)
        _compare(velocity, i, by_positions, 0.5 * (arm.qd[i] + velocity.qd_before[i]), dt, learning)
        source = choice
        if choice == _QUIETER_OF_TWO:
            known = velocity.ticks > max(_LEAST_TICKS, _LEAST_S / dt)
            source = _quieter(velocity, i, dt) if known else velocity.source[i]
        velocity.changed = 1 if source != velocity.source[i] else velocity.changed
        velocity.source[i], velocity.qd[i] = source, arm.qd[i]
        if source == _POSITIONS:
            velocity.qd[i], velocity.of_positions = by_positions, 1
    velocity.q_before[:], velocity.qd_before[:] = arm.q, arm.qd
    if velocity.ticks < _RESUMED and velocity.of_positions != 0:
        velocity.changed = 1
    velocity.between, velocity.since_before = 0.5 * (since + velocity.since_before), since
    return velocity.between if velocity.of_positions != 0 else since


@inlined
def is_of_middle(velocity: Record, i: int) -> bool:
    """Tell whether joint i's velocity is of the middle between two measurements, as a difference of positions is."""
    return velocity.source[i] == _POSITIONS


@inlined
def _compare(velocity: Record, i: int, by_positions: float, by_robot: float, dt: float, learning: bool) -> None:
    """Follow the noise of joint i's positions, and what its two velocities differ by."""
    apart = by_robot - by_positions
    velocity.apart[i] += filter_gain(_BAND_1_S, dt) * (apart - velocity.apart[i])
    third = _third_difference(velocity.difference[i], by_positions * dt)
    beside_motion = _third_difference(velocity.apart_difference[i], -apart * dt)
    squared = min(third * third, beside_motion * beside_motion)
    if learning:
        gain = max(1.0 / max(velocity.ticks - 3.0, 1.0), dt / _MEMORY_S)
        velocity.apart_variance[i] += gain * (velocity.apart[i] * velocity.apart[i] - velocity.apart_variance[i])
        velocity.third_variance[i] += gain * (squared - velocity.third_variance[i])


@inlined
def _third_difference(difference: Vector, first: float) -> float:
    second = first - difference[0]
    third = second - difference[1]
    difference[0], difference[1] = first, second
    return third


@inlined
def _quieter(velocity: Record, i: int, dt: float) -> int:
    """Return the source whose noise below 50 Hz is less; the one in force where they hardly differ.

    White noise of positions has a third difference of variance 20 σ_q²; as a velocity behind a first-order filter that
    takes up a fraction a, it has 2 a² / (2 − a) σ_q² / dt².
    """
    band = filter_gain(_BAND_1_S, dt)
    of_positions = 2.0 * band * band / (2.0 - band) * velocity.third_variance[i] / (20.0 * dt * dt)
    of_robot = max(velocity.apart_variance[i] - of_positions, 0.0)
    if of_positions < _QUIETER * of_robot and of_robot > _NONE:
        return _POSITIONS
    return _ROBOT if of_robot <= _QUIETER * of_positions else int(velocity.source[i])
