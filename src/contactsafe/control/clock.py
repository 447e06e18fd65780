"""What time does to measurements: how much of it passed, which of them can be true, what stands in for the others.

A measurement is held against the last good one: joints move between the two no faster and no slower than both
velocities say. What does not fit, is missing, or is the very last one again is bridged: the nominal dynamics predict
where the arm is. After `BRIDGE_TICKS` the arm is braked. A clock that stands or goes back while joints move is wrong:
then the joints tell the time. `docs/concepts/clocks.md` derives the bounds.
"""

import math

from contactsafe.control.laws import task_error
from contactsafe.control.records import CLOCK, CONTACT, MISSING, OVERDUE, REPEATED, UNTRUE
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, matvec, matvec_into, matvec_t_into
from contactsafe.core.rotation import matrix_to_quat, quat_multiply, rotvec_to_quat
from contactsafe.core.stack import stack_vector

BRIDGE_TICKS = 20
"""Ticks in a row that are bridged at most; after more of them the arm is braked until it is reset."""

_OVERDUE_TICKS = BRIDGE_TICKS + 1.5

_SLACK_RAD = 1.5e-4
"""By which positions may depart from what velocities say: encoders of 16 bit, velocities that are filtered."""

_SWAY = 0.15
"""Share of a joint's way by which it may sway within a late tick, unseen."""

_UNTRUE_RAD = 1e-3
"""More of it a tick is no filter's lag after an impact any more."""

_JUMP_NM = 10.0
"""A change of velocity that takes more than this a tick must show in the positions as well."""

_AT_REST_RAD_S = 1e-6
"""Only a simulator stands as still as this; what it says twice is true twice."""

_SAME_TIME_TICKS = 0.05
"""Two measurements no further apart are the same one."""

_STUCK_RAD = 2e-5
"""An arm that should have moved this far, and whose measurement has not changed in one bit, is not measured."""

_SAME_PACE = 0.4
"""A pace within this of one tick a call is taken for it: velocities that are filtered feign as much."""

_PACE_RAD2, _PACE_UNKNOWN, _PACE_KNOWN, _STANDS_RAD2 = 5e-5**2, 0.25, 0.02**2, 1e-14
"""Variance of positions; of the pace, in ticks a call, at first and at the best; joints that do not move in a tick."""

_SHAKES = 0.25
"""A joint whose velocity changes by more than this share of itself in half a tick does not tell how long that was."""

_BRAKE = 10.0
"""Corner of the brake, critically damped, 1/s: speed is gone within some 0.2 s."""

_SLOW_RAD_S = 0.05
_HOLD_RAD = 0.1


@compiled
def receive(c, usable):
    """Take the measurement over, or predict what it should have been; count the ticks that passed.

    Args:
        c: `controller_dtype` record.
        usable: what `is_usable` says.
    """
    state = c.state
    usual = 1.0 if abs(state.pace - 1.0) < _SAME_PACE else state.pace
    reason, since, timed = _judge(c, state.since + usual) if usable else (MISSING, state.since + usual, False)
    if state.braking != 0 and reason == UNTRUE:
        reason, state.rests = 0, 0  # whatever is measured now is where the arm is
    if reason == 0:
        _accept(c, since, timed)
    else:
        _predict(c, usual * c.params.dt)
        state.elapsed = usual
        state.since += usual
        state.bridged += 1
    overdue = reason == 0 and since > _OVERDUE_TICKS
    resting = reason == REPEATED and since > 0.0 and not _should_have_moved(state)
    lasting = reason != 0 and not resting and state.since > BRIDGE_TICKS + 0.5
    if (overdue or lasting) and state.braking == 0:
        state.braking, state.rests = 1, 0
        state.fault = OVERDUE if overdue else reason
    c.output.bridged = state.bridged


@compiled
def _judge(c, ticks):
    """Tell what is wrong with the measurement, how many ticks passed since the last good one, whether a clock says so.

    Nothing is wrong: 0. No tick passed where it is the last one again by its time as well.

    Args:
        c: `controller_dtype` record.
        ticks: that passed if none came late.
    """
    state, m = c.state, c.measurement
    state.unclear = 0
    if state.started == 0:
        return 0, 1.0, False
    unchanged, timed = _is_unchanged(state, m), m.has_time != 0 and state.timed != 0
    if timed and unchanged and abs(m.time - state.time) <= _SAME_TIME_TICKS * c.params.dt:
        return REPEATED, 0.0, True
    if timed:
        told = _ticks_told(c)
        timed = _is_believed(state, told)
        ticks = told if timed else ticks
    if unchanged and _moves(m):
        return REPEATED, ticks, timed
    if ticks > _OVERDUE_TICKS:
        return 0, ticks, timed
    astray = _astray(c, ticks)
    if astray > _SLACK_RAD:
        late = 0.0 if timed else _ticks_from_motion(c, ticks)
        if late > 0.0:
            return 0, late, False
        if astray > _UNTRUE_RAD * max(ticks, 1.0) or (not timed and _out_of_reach(c)):
            return UNTRUE, ticks, timed
        state.unclear = 1 if ticks > 1.5 and not timed else 0
        return 0, ticks, timed
    return (UNTRUE if _velocity_jumps(c, ticks) else 0), ticks, timed


@compiled
def _ticks_told(c):
    """Ticks since the last good measurement by its time and that of this one."""
    state = c.state
    return (c.measurement.time - state.time) / c.params.dt - state.lead


@compiled
def _is_believed(state, told):
    """Tell whether a clock is believed by which so many ticks passed; latch the fault of one that did not go on.

    Such a one is not believed either, until reset, where it is far ahead: that is no reason to brake.
    """
    if not told > _SAME_TIME_TICKS:
        state.doubted = 1
        if state.fault == 0:
            state.fault = CLOCK
        return False
    return state.doubted == 0 or told <= _OVERDUE_TICKS


@compiled
def is_usable(c):
    """Tell whether every number of the measurement is one that this arm can have.

    A broken force sensor stops the arm, but it is braked by its joints, which are still seen.
    """
    m, params = c.measurement, c.params
    for i in range(m.q.shape[0]):
        if not (params.q_least[i] <= m.q[i] <= params.q_most[i] and abs(m.qd[i]) <= params.qd_most[i]):
            return False
    if m.has_time != 0 and not math.isfinite(m.time):
        return False
    return m.has_wrench == 0 or c.state.braking != 0 or all_usable(m.wrench_ee)


@compiled
def all_usable(x):
    """Tell whether no number of x is absurd: 10⁶ or more in SI units, infinite, or none at all."""
    for i in range(x.shape[0]):
        if not abs(x[i]) < 1e6:  # NaN as well
            return False
    return True


@compiled
def _is_unchanged(state, m):
    """Tell whether all joints are measured as before to the bit."""
    for i in range(m.q.shape[0]):
        if m.q[i] != state.q_good[i] or m.qd[i] != state.qd_good[i]:
            return False
    return True


@compiled
def _moves(m):
    """Tell whether a joint moves: noise and motion never repeat, a simulator at rest does."""
    for i in range(m.qd.shape[0]):
        if abs(m.qd[i]) > _AT_REST_RAD_S:
            return True
    return False


@compiled
def _astray(c, ticks):
    """Largest distance of a joint from where its two velocities, before and now, allow it to be, rad."""
    state, m = c.state, c.measurement
    time, most = ticks * c.params.dt, 0.0
    for i in range(m.q.shape[0]):
        way, before, now = m.q[i] - state.q_good[i], state.qd_good[i], m.qd[i]
        most = max(most, way - time * max(before, now), time * min(before, now) - way)
    return most


@compiled
def _out_of_reach(c):
    """Tell whether a joint is further from where it is believed to be than any joint goes in the ticks bridged."""
    state, m = c.state, c.measurement
    fastest, furthest = 0.0, 0.0
    for i in range(m.q.shape[0]):
        fastest = max(fastest, abs(m.qd[i]), abs(state.qd_good[i]))
        furthest = max(furthest, abs(m.q[i] - state.q[i]))
    return furthest > _UNTRUE_RAD + _OVERDUE_TICKS * c.params.dt * fastest


@compiled
def _velocity_jumps(c, ticks):
    """Tell whether a joint's velocity changed as nothing but a large torque changes it, and its position denies it."""
    state, m, M = c.state, c.measurement, c.dynamics.M
    time = ticks * c.params.dt
    for i in range(m.q.shape[0]):
        jump = m.qd[i] - state.qd_good[i]
        if abs(jump) * M[i, i] > _JUMP_NM * max(time, c.params.dt):
            shown = (m.q[i] - state.q_good[i]) / time - state.qd_good[i]
            if shown * jump < 0.25 * jump * jump:
                return True
    return False


@compiled
def _ticks_from_motion(c, ticks):
    """Find how many ticks passed, where no clock says it, from how far the joints went; 0 where that explains nothing.

    The least-squares N of Δq = N dt q̇ over all joints. It must leave every joint where its velocities allow, but for a
    share of the way, and must not contradict what the command did to them: filtered velocity looks like a late tick.
    More ticks than can be bridged are not believed at once: a wrong reading of the one joint that moves looks so too.
    """
    state, m, dt = c.state, c.measurement, c.params.dt
    n = m.q.shape[0]
    way, squares, longest = 0.0, 0.0, 0.0
    for i in range(n):
        longest = max(longest, abs(m.q[i] - state.q_good[i]))
        mean = 0.5 * (state.qd_good[i] + m.qd[i])
        way += (m.q[i] - state.q_good[i]) * mean
        squares += mean * mean
    found = way / (squares * dt) if squares > 0.0 else 0.0
    if not ticks + 0.5 <= found <= _OVERDUE_TICKS or _astray(c, found) > _SLACK_RAD + _SWAY * longest:
        return 0.0
    change, net = stack_vector(n), _net_torque(c, stack_vector(n))
    for i in range(n):
        change[i] = m.qd[i] - state.qd_good[i]
    gained = dot(net, matvec_into(c.dynamics.M, change, stack_vector(n))) / dt
    size = dot(net, net)
    return found if size < 1.0 or 2.0 * gained >= (found + ticks) * size else 0.0


@compiled
def _accept(c, since, timed):
    """Take the measurement over; `timed` where its clock told how many ticks passed.

    A clock that stands or stutters is counted on, one that was set anew goes on from there.
    """
    state, m = c.state, c.measurement
    if state.started == 0:
        state.pace, state.pace_variance = 1.0, _PACE_UNKNOWN
    elif timed:
        state.pace += 0.1 * (min(since / (state.bridged + 1.0), state.pace + 1.0) - state.pace)
    elif state.bridged == 0:
        _learn_pace(c)
    state.elapsed = min(max(since - state.since, 0.0), BRIDGE_TICKS + 1.0)
    if state.bridged > 0 or since > _OVERDUE_TICKS:
        state.rests = 0  # a brake that holds a place that was predicted lets go of it
    disbelieved = not timed and m.has_time != 0 and state.timed != 0
    told = _ticks_told(c) if disbelieved else since
    state.lead = since - told if abs(told) <= _OVERDUE_TICKS else 0.0
    state.since, state.bridged = since, 0
    state.q[:], state.qd[:] = m.q, m.qd
    state.q_good[:], state.qd_good[:] = m.q, m.qd
    state.time, state.timed = m.time, m.has_time
    state.has_wrench = 1 if m.has_wrench != 0 and all_usable(m.wrench_ee) else 0
    if state.has_wrench != 0:
        state.wrench_ee[:] = m.wrench_ee


@compiled
def _learn_pace(c):
    """Learn how many ticks of time a call comes to where no clock says it, from how far the joints go: Kalman's filter.

    A moving arm tells it precisely, one at rest not at all, and one whose velocity changes as much as it moves little:
    what lies between two velocities is not known. A single late tick is none of it, many are.
    """
    state, m, dt = c.state, c.measurement, c.params.dt
    way, squares, unknown = 0.0, 0.0, _PACE_RAD2
    for i in range(m.q.shape[0]):
        mean, change = 0.5 * dt * (state.qd_good[i] + m.qd[i]), 0.5 * dt * (m.qd[i] - state.qd_good[i])
        way += (m.q[i] - state.q_good[i]) * mean
        squares += mean * mean
        unknown += max(change * change - (_SHAKES * mean) ** 2, 0.0)
    if squares < _STANDS_RAD2:
        return
    variance, news = unknown / squares, way / squares - state.pace
    if news * news > 9.0 * (state.pace_variance + variance):
        state.pace_variance = min(state.pace_variance + 0.02, _PACE_UNKNOWN)
        return
    share = state.pace_variance / (state.pace_variance + variance)
    state.pace = min(max(state.pace + share * news, 0.1), BRIDGE_TICKS + 0.0)
    state.pace_variance = max((1.0 - share) * state.pace_variance, _PACE_KNOWN)


@compiled
def _predict(c, dt):
    """Move the believed arm on by dt s: q̈ = M⁻¹ (tau − friction − c − g + tau_ext), the last contact going on."""
    state, n = c.state, c.state.q.shape[0]
    net = _net_torque(c, stack_vector(n))
    qdd = matvec_into(c.dynamics.M_inv, net, stack_vector(n))
    for i in range(n):
        state.qd[i] = min(max(state.qd[i] + dt * qdd[i], -c.params.qd_most[i]), c.params.qd_most[i])
        state.q[i] = min(max(state.q[i] + dt * state.qd[i], c.params.q_least[i]), c.params.q_most[i])


@compiled
def _net_torque(c, out):
    """Fill what accelerates the arm by all that is known, (n,), N m, and give it back.

    While braking no contact is counted on: what the arm pressed against lets go as it stops pressing.
    """
    state, dynamics = c.state, c.dynamics
    touched = state.mode == CONTACT
    external = state.residual_fast if touched else state.residual
    out[:] = 0.0
    if state.has_wrench != 0 and c.params.cancel_tool_wrench != 0 and state.braking == 0:
        matvec_t_into(dynamics.J, state.wrench_ee, out)
    for i in range(out.shape[0]):
        if not (touched and state.braking != 0):
            out[i] += external[i]
        out[i] += state.tau[i] - state.friction[i] - dynamics.c[i] - dynamics.g[i]
    return out


@compiled
def _should_have_moved(state):
    for i in range(state.q.shape[0]):
        if abs(state.q[i] - state.q_good[i]) > _STUCK_RAD:
            return True
    return False


@compiled
def set_step(c, ticks):
    """Resolve what a tick's filters and times come to when so many ticks passed in it."""
    step, params = c.state.step, c.params
    step.ticks, step.dt = ticks, ticks * params.dt
    step.detection_filter_gain = _over(params.detection_filter_gain, ticks)
    step.compensation_filter_gain = _over(params.compensation_filter_gain, ticks)
    step.lowpass_gain = _over(params.lowpass_gain, ticks)
    step.recover_gain = _over(params.recover_gain, ticks)
    step.probe_gain = _over(params.probe_gain, ticks)
    step.reject_recover_gain = _over(params.reject_recover_gain, ticks)
    step.tool_share = _over(params.tool_share, ticks)
    step.torque_step = params.torque_step * min(ticks, 1.0)


@compiled
def _over(share, ticks):
    """Share of its way that a first-order filter goes in so many ticks, from that of one."""
    return share if ticks == 1.0 else 1.0 - (1.0 - share) ** ticks


@compiled
def stop_torque(c):
    """Stop all joints alike and hold them there: −M (2 ω q̇ + ω² (q − q_hold)), (n,), N m, without c and g.

    Critically damped whatever the joints' inertia. q_hold is where the arm comes to rest.
    """
    state = c.state
    n = state.q.shape[0]
    if state.rests == 0:
        state.q_hold[:] = state.q
        state.rests = 1
        for i in range(n):
            if abs(state.qd[i]) > _SLOW_RAD_S:
                state.rests = 0
    wanted = stack_vector(n)
    for i in range(n):
        away = min(max(state.q[i] - state.q_hold[i], -_HOLD_RAD), _HOLD_RAD)
        wanted[i] = -2.0 * _BRAKE * state.qd[i] - _BRAKE * _BRAKE * away
    return matvec(c.dynamics.M, wanted)


@compiled
def stop_late_target(c):
    """Where no new target has come for too long, put x_d where the tool comes to rest by itself, if that is nearer.

    That is x + ẋ D/K on every axis, where what pulls the tool is just what damps it: nothing jumps.
    """
    state, params, dynamics = c.state, c.params, c.dynamics
    if c.target.kept == 0:
        state.target_age, state.target_late = 0.0, 0
        return
    state.target_age += state.elapsed
    if state.target_late != 0 or state.target_age * params.dt <= params.target_timeout_s:
        return
    state.target_late, target = 1, state.target
    coasts = stack_vector(6)
    for i in range(6):
        coasts[i] = dynamics.velocity[i] * target.D_task[i] / target.K_task[i]
    error = task_error(target.position, target.quat, dynamics.position, dynamics.rotation)
    if dot(error[:3], error[:3]) > dot(coasts[:3], coasts[:3]):
        target.position[:] = dynamics.position
        target.position += coasts[:3]
    if dot(error[3:], error[3:]) > dot(coasts[3:], coasts[3:]):
        target.quat[:] = quat_multiply(rotvec_to_quat(coasts[3:]), matrix_to_quat(dynamics.rotation))
    target.q_posture[:] = state.q
