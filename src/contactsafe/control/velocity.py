"""Velocity: that of the robot's own signal, or the difference of its positions, whichever is quieter.

What a noisy velocity does to the residual is what its acceleration shows behind the detecting filters. The arm's motion
is in both sources, a = s + n_a and b = s + n_b, so the noise of one is what it has not in common with the other:
E n_a² = E a (a − b).
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

_BAND_1_S, _SLOW_1_S = 250.0, 25.0
"""Accelerations are compared between 4 and 40 Hz: what is faster the observer filters, what is slower is motion."""

_MEMORY_S = 1.0

_IN_TIME = (0.3, 2.5)
"""Ticks between two measurements that are compared."""

_LEAST_S, _LEAST_TICKS = 0.06, 10.0
"""After so long, and so many measurements, both are compared first."""

_SETTLE_TICKS = 3.0
"""Measurements in time after a gap from which on velocities are compared: accelerations over a gap are none."""

_RESUMED = 2.0
"""Measurements in time after a gap, from which on differences of positions are compared again."""

_NONE = 1e-3
"""Noise of an acceleration that is none, rad²/s⁴: it makes a residual of some hundredths of a newton metre."""

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
            ("by_positions", _f, (n,)),  # their last difference over its time, rad/s
            ("filters", _f, (n, 2, 3)),  # of the acceleration of either source: below 40 Hz, twice, and below 4, rad/s²
            ("variance", _f, (n, 2)),  # of the noise in what lies between, rad²/s⁴
            ("ticks", _f),  # in a row that were measured in time
            ("seconds", _f),  # for which the variances were learned
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
    velocity.by_positions[:] = qd
    velocity.ticks, velocity.seconds, velocity.since_before, velocity.between, velocity.fresh = 0.0, 0.0, 1.0, 1.0, 1


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
    velocity.changed, velocity.of_positions = 0, 0
    if choice == _ROBOT or velocity.fresh != 0:
        velocity.qd[:], velocity.fresh = arm.qd, 0
        return since
    in_time = _IN_TIME[0] < since < _IN_TIME[1]
    velocity.ticks = velocity.ticks + 1.0 if in_time else 0.0
    settled = velocity.ticks > _SETTLE_TICKS
    velocity.seconds += since * dt if settled and untouched else 0.0
    known = velocity.seconds > max(_LEAST_S, _LEAST_TICKS * dt)
    for i in range(arm.q.shape[0]):
        by_positions = (arm.q[i] - velocity.q_before[i]) / (since * dt)
        if settled:
            _compare(velocity, i, by_positions, arm.qd[i], since * dt, untouched)
        source = choice
        if choice == _QUIETER_OF_TWO:
            source = _quieter(velocity.variance[i], velocity.source[i]) if known else velocity.source[i]
        _take(velocity, i, source, by_positions if source == _POSITIONS else arm.qd[i])
        velocity.by_positions[i] = by_positions
    velocity.q_before[:], velocity.qd_before[:] = arm.q, arm.qd
    if velocity.ticks < _RESUMED and velocity.of_positions != 0:
        velocity.changed = 1
    velocity.between, velocity.since_before = 0.5 * (since + velocity.since_before), since
    return velocity.between if velocity.of_positions != 0 else since


@inlined
def _take(velocity: Record, i: int, source: int, qd: float) -> None:
    """Take one source's velocity of joint i for that in force."""
    velocity.changed = 1 if source != velocity.source[i] else velocity.changed
    velocity.of_positions = 1 if source == _POSITIONS else velocity.of_positions
    velocity.source[i], velocity.qd[i] = source, qd


@inlined
def is_of_middle(velocity: Record, i: int) -> bool:
    """Tell whether joint i's velocity is of the middle between two measurements, as a difference of positions is."""
    return velocity.source[i] == _POSITIONS


@inlined
def _compare(velocity: Record, i: int, by_positions: float, by_robot: float, dt: float, untouched: bool) -> None:
    """Follow the noise in the acceleration of joint i by either velocity."""
    filters, variance = velocity.filters[i], velocity.variance[i]
    by_robot = _within_band(filters[_ROBOT], (by_robot - velocity.qd_before[i]) / dt, dt)
    by_positions = _within_band(filters[_POSITIONS], (by_positions - velocity.by_positions[i]) / dt, dt)
    if untouched:
        gain = dt / min(velocity.seconds, _MEMORY_S)
        variance[_ROBOT] += gain * (by_robot * (by_robot - by_positions) - variance[_ROBOT])
        variance[_POSITIONS] += gain * (by_positions * (by_positions - by_robot) - variance[_POSITIONS])


@inlined
def _within_band(filters: Vector, x: float, dt: float) -> float:
    """Advance a band's filters, (3,), and return what of x is within it."""
    gain = filter_gain(_BAND_1_S, dt)
    filters[0] += gain * (x - filters[0])
    filters[1] += gain * (filters[0] - filters[1])
    filters[2] += filter_gain(_SLOW_1_S, dt) * (filters[1] - filters[2])
    return filters[1] - filters[2]


@inlined
def _quieter(variance: Vector, source: int) -> int:
    """Return the source of less variance, (2,); the one in force where they hardly differ, or it has no noise."""
    other = _ROBOT if source == _POSITIONS else _POSITIONS
    return other if variance[other] < _QUIETER * variance[source] and variance[source] > _NONE else source
