"""How much time passed where no clock says it: from how far the joints went."""

from contactsafe.control.plausibility import BRIDGE_TICKS, NOISE_RAD_S, OVERDUE_TICKS, SLACK_RAD, furthest_astray
from contactsafe.control.prediction import net_torque
from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, matvec_into
from contactsafe.core.stack import stack_vector

_SWAY = 0.15
"""Fraction of a joint's motion by which it may sway within a late tick, unseen."""

_PACE_RAD2, PACE_UNKNOWN, _PACE_KNOWN = 5e-5**2, 0.25, 0.02**2
"""Variance of positions; of the pace, in ticks a call, at first and at the best."""

_SHAKES = 0.25
"""A joint whose velocity changes by more than this fraction of itself in half a tick does not tell its length."""


@compiled
def ticks_from_motion(state: Record, m: Record, dynamics: Record, params: Record, ticks: float) -> float:
    """Find how many ticks passed, where no clock says it, from how far the joints went; 0 where that explains nothing.

    The least-squares N of Δq = N dt q̇ over all joints. It must leave every joint where its velocities allow, but for a
    fraction of that, and must not contradict what the command did to them: filtered velocity looks like a late tick.
    More ticks than can be bridged are not believed at once: a wrong reading of the one joint that moves looks so too.
    """
    clock, dt = state.clock, params.clock.dt
    n = m.q.shape[0]
    along, squares, longest = 0.0, 0.0, 0.0
    for i in range(n):
        longest = max(longest, abs(m.q[i] - clock.q_good[i]))
        mean = 0.5 * (clock.qd_good[i] + m.qd[i])
        along += (m.q[i] - clock.q_good[i]) * mean
        squares += mean * mean
    found = along / (squares * dt) if squares > 0.0 else 0.0
    if not ticks + 0.5 <= found <= OVERDUE_TICKS or furthest_astray(clock, m, found * dt) > SLACK_RAD + _SWAY * longest:
        return 0.0
    change, net = stack_vector(n), net_torque(state, dynamics, params.observer, stack_vector(n))
    for i in range(n):
        change[i] = m.qd[i] - clock.qd_good[i]
    gained = dot(net, matvec_into(dynamics.M, change, stack_vector(n))) / dt
    size = dot(net, net)
    return found if size < 1.0 or 2.0 * gained >= (found + ticks) * size else 0.0


@compiled
def learn_pace(clock: Record, m: Record, dt: float) -> None:
    """Learn how many ticks of time a call comes to where no clock says it, from how far the joints go: Kalman's filter.

    A moving arm tells it precisely. One at rest tells nothing, what its velocity shows is noise, and one whose velocity
    changes as much as it moves little: what lies between two velocities is not known. A single late tick is none of it,
    many are.
    """
    along, squares, uncertain = 0.0, 0.0, _PACE_RAD2
    for i in range(m.q.shape[0]):
        mean, change = 0.5 * dt * (clock.qd_good[i] + m.qd[i]), 0.5 * dt * (m.qd[i] - clock.qd_good[i])
        if abs(mean) < NOISE_RAD_S * dt:
            continue
        along += (m.q[i] - clock.q_good[i]) * mean
        squares += mean * mean
        uncertain += max(change * change - (_SHAKES * mean) ** 2, 0.0)
    if squares == 0.0:
        return
    variance, news = uncertain / squares, along / squares - clock.pace
    if news * news > 9.0 * (clock.pace_variance + variance):
        clock.pace_variance = min(clock.pace_variance + 0.02, PACE_UNKNOWN)
        return
    gain = clock.pace_variance / (clock.pace_variance + variance)
    clock.pace = min(max(clock.pace + gain * news, 0.1), BRIDGE_TICKS + 0.0)
    clock.pace_variance = max((1.0 - gain) * clock.pace_variance, _PACE_KNOWN)
