"""Which measurements can be true: held against the last good one, and against what the command can have done.

Joints move between two measurements no faster and no slower than both velocities say. `docs/concepts/clocks.md`
derives the bounds.
"""

import math

from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled

BRIDGE_TICKS = 20
"""Ticks in a row that are bridged at most; after more of them the arm is braked until it is reset."""

_MOST_TORQUE = 10.0
"""Multiple of a joint's torque limit beyond which no sensor of it is believed."""

OVERDUE_TICKS = BRIDGE_TICKS + 1.5

SLACK_RAD = 1.5e-4
"""By which positions may depart from what velocities say: encoders of 16 bit, velocities that are filtered."""

UNTRUE_RAD = 1e-3
"""More of it a tick is no filter's lag after an impact any more."""

_JUMP_NM = 10.0
"""A change of velocity that takes more than this a tick must show in the positions as well."""

NOISE_RAD_S = 0.03
"""By so much a real robot's velocity may jump by noise alone: five times the 4 to 6 mrad/s of a Panda's."""

_AT_REST_RAD_S = 1e-6
"""Only a simulator stands as still as this; what it says twice is true twice."""

_STUCK_RAD = 2e-5
"""An arm that should have moved this far, and whose measurement has not changed in one bit, is not measured."""


@compiled
def is_usable(m: Record, arm: Record, braking: int) -> bool:
    """Tell whether every number of a measurement is one that this arm can have.

    A broken sensor of force or torque stops the arm, which its joints still brake; one under the base does not.

    Args:
        m: `measurement_dtype` record.
        arm: `arm_dtype` record.
        braking: whether the arm is braked.
    """
    for i in range(m.q.shape[0]):
        if not (arm.q_least[i] <= m.q[i] <= arm.q_most[i] and abs(m.qd[i]) <= arm.qd_most[i]):
            return False
    if m.has_time != 0 and not math.isfinite(m.time):
        return False
    if braking != 0:
        return True
    if m.has_wrench != 0 and not all_usable(m.wrench_ee):
        return False
    for i in range(m.torque.shape[0]):
        if m.has_torque != 0 and not abs(m.torque[i]) < _MOST_TORQUE * arm.tau_max[i]:  # NaN as well
            return False
    return True


@compiled
def all_usable(x: Vector) -> bool:
    """Tell whether no number of x is absurd: 10⁶ or more in SI units, infinite, or none at all."""
    for i in range(x.shape[0]):
        if not abs(x[i]) < 1e6:  # NaN as well
            return False
    return True


@compiled
def is_unchanged(clock: Record, m: Record) -> bool:
    """Tell whether all joints are measured as before to the bit."""
    for i in range(m.q.shape[0]):
        if m.q[i] != clock.q_good[i] or m.qd[i] != clock.qd_good[i]:
            return False
    return True


@compiled
def moves(m: Record) -> bool:
    """Tell whether a joint moves: noise and motion never repeat, a simulator at rest does."""
    for i in range(m.qd.shape[0]):
        if abs(m.qd[i]) > _AT_REST_RAD_S:
            return True
    return False


@compiled
def furthest_astray(clock: Record, m: Record, time: float) -> float:
    """Return the largest distance of a joint from where its two velocities, before and now, allow it to be, rad."""
    most = 0.0
    for i in range(m.q.shape[0]):
        moved, before, now = m.q[i] - clock.q_good[i], clock.qd_good[i], m.qd[i]
        most = max(most, moved - time * max(before, now), time * min(before, now) - moved)
    return most


@compiled
def out_of_reach(clock: Record, m: Record, q: Vector, dt: float) -> bool:
    """Tell whether a joint is further from where it is believed to be, q, than any goes in the ticks bridged."""
    fastest, furthest = 0.0, 0.0
    for i in range(m.q.shape[0]):
        fastest = max(fastest, abs(m.qd[i]), abs(clock.qd_good[i]))
        furthest = max(furthest, abs(m.q[i] - q[i]))
    return furthest > UNTRUE_RAD + OVERDUE_TICKS * dt * fastest


@compiled
def velocity_jumps(clock: Record, m: Record, M: Matrix, time: float, dt: float) -> bool:
    """Tell whether a joint's velocity changed as nothing but a large torque changes it, and its position denies it."""
    for i in range(m.q.shape[0]):
        jump = m.qd[i] - clock.qd_good[i]
        if abs(jump) > NOISE_RAD_S and abs(jump) * M[i, i] > _JUMP_NM * max(time, dt):
            shown = (m.q[i] - clock.q_good[i]) / time - clock.qd_good[i]
            if shown * jump < 0.25 * jump * jump:
                return True
    return False


@compiled
def should_have_moved(arm: Record, clock: Record) -> bool:
    """Tell whether a joint is believed to be elsewhere than where it was last measured."""
    for i in range(arm.q.shape[0]):
        if abs(arm.q[i] - clock.q_good[i]) > _STUCK_RAD:
            return True
    return False
