"""What time does to measurements: how much of it passed, which of them is believed, when one is bridged.

A measurement is held against the last good one. What does not fit, is missing, or is the very last one again is
bridged by a prediction. After `BRIDGE_TICKS` the arm is braked. A clock that stands or goes back while joints move is
wrong: then the joints tell the time. `docs/concepts/clocks.md` derives the bounds.
"""

import numpy as np

from contactsafe.control.codes import BAD_BASE, CLOCK, MISSING, OVERDUE, REPEATED, UNTRUE
from contactsafe.control.pace import PACE_UNKNOWN, learn_pace, ticks_from_motion
from contactsafe.control.plausibility import (
    BRIDGE_TICKS,
    OVERDUE_TICKS,
    SLACK_RAD,
    UNTRUE_RAD,
    all_usable,
    furthest_astray,
    is_unchanged,
    moves,
    out_of_reach,
    should_have_moved,
    velocity_jumps,
)
from contactsafe.control.prediction import net_torque, predict
from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled
from contactsafe.core.stack import stack_vector
from contactsafe.robot.friction import joint_drag_into

_f = np.float64
_i = np.int64

_SAME_TIME_TICKS = 0.05
"""Two measurements no further apart are the same one."""

_SAME_PACE = 0.4
"""A pace within this of one tick a call is taken for it: velocities that are filtered feign as much."""


def clock_dtype(n: int) -> np.dtype:
    """Describe what is remembered of measurements and their time."""
    return np.dtype(
        [
            ("q_good", _f, (n,)),  # last good measurement, rad
            ("qd_good", _f, (n,)),  # rad/s
            ("time", _f),  # of it, s
            ("has_time", _i),  # 0 where that is not known
            ("offset", _f),  # of the time as counted from it, where the clock is wrong, ticks
            ("distrusted", _i),  # 1 once the clock was wrong, until reset
            ("pace", _f),  # ticks of time that a call usually comes to
            ("pace_variance", _f),
            ("elapsed", _f),  # ticks of time that passed since the last tick
            ("since", _f),  # ticks of time between the last good measurement and the one before it, or now
            ("unclear", _i),  # 1 where that time is not known for sure
            ("bridged", _i),  # ticks in a row whose measurement was predicted
            ("braking", _i),  # 1 once the arm is braked, until reset
            ("at_rest", _i),  # 1 once it was braked to rest
            ("q_hold", _f, (n,)),  # where, rad
            ("target_age", _f),  # ticks of time since a new target came
            ("target_late", _i),  # 1 where that is too long ago
        ]
    )


@compiled
def receive(c: Record, usable: bool) -> None:
    """Take a measurement that `is_usable` over, or predict what it should have been; count the ticks that passed."""
    state, clock = c.state, c.state.clock
    usual = 1.0 if abs(clock.pace - 1.0) < _SAME_PACE else clock.pace
    reason, since, timed = MISSING, clock.since + usual, False
    if usable:
        reason, since, timed = _assess(state, c.measurement, c.dynamics, c.params, since)
    if clock.braking != 0 and reason == UNTRUE:
        reason, clock.at_rest = 0, 0  # whatever is measured now is where the arm is
    if reason == 0:
        _accept(state, c.measurement, c.params.clock.dt, since, timed)
        if state.arm.has_torque != 0 and c.params.arm.sensor_errs != 0:
            _correct_torque(state.arm, c.params.arm)
    else:
        net = net_torque(state, c.dynamics, c.params.observer, stack_vector(state.arm.q.shape[0]))
        predict(state.arm, net, c.dynamics.M_inv, usual * c.params.clock.dt, c.params.arm)
        clock.elapsed, clock.since = usual, clock.since + usual
        clock.bridged += 1
    overdue = reason == 0 and since > OVERDUE_TICKS
    resting = reason == REPEATED and since > 0.0 and not should_have_moved(state.arm, clock)
    lasting = reason != 0 and not resting and clock.since > BRIDGE_TICKS + 0.5
    if (overdue or lasting) and clock.braking == 0:
        clock.braking, clock.at_rest = 1, 0
        state.fault = OVERDUE if overdue else reason
    c.output.bridged = clock.bridged


@compiled
def _assess(state: Record, m: Record, dynamics: Record, params: Record, ticks: float) -> tuple[int, float, bool]:
    """Tell what is wrong with the measurement, how many ticks passed since the last good one, whether a clock says so.

    Nothing is wrong: 0. No tick passed where it is the last one again by its time as well.

    Args:
        state: `state_dtype` record; only what its clock says of itself is changed.
        m: `measurement_dtype` record.
        dynamics: of the last tick.
        params: `params_dtype` record.
        ticks: that passed if none came late.
    """
    clock, dt = state.clock, params.clock.dt
    clock.unclear = 0
    if state.started == 0:
        return 0, 1.0, False
    unchanged, timed = is_unchanged(clock, m), m.has_time != 0 and clock.has_time != 0
    if timed and unchanged and abs(m.time - clock.time) <= _SAME_TIME_TICKS * dt:
        return REPEATED, 0.0, True
    if timed:
        told = _ticks_told(clock, m, dt)
        timed = _is_believed(state, told)
        ticks = told if timed else ticks
    if unchanged and moves(m):
        return REPEATED, ticks, timed
    if ticks > OVERDUE_TICKS:
        return 0, ticks, timed
    astray = furthest_astray(clock, m, ticks * dt)
    if astray > SLACK_RAD:
        late = 0.0 if timed else ticks_from_motion(state, m, dynamics, params, ticks)
        if late > 0.0:
            return 0, late, False
        if astray > UNTRUE_RAD * max(ticks, 1.0) or (not timed and out_of_reach(clock, m, state.arm.q, dt)):
            return UNTRUE, ticks, timed
        clock.unclear = 1 if ticks > 1.5 and not timed else 0
        return 0, ticks, timed
    return (UNTRUE if velocity_jumps(clock, m, dynamics.M, ticks * dt, dt) else 0), ticks, timed


@compiled
def _ticks_told(clock: Record, m: Record, dt: float) -> float:
    """Return the ticks since the last good measurement by its time and that of this one."""
    return (m.time - clock.time) / dt - clock.offset


@compiled
def _is_believed(state: Record, told: float) -> bool:
    """Tell whether a clock is believed by which so many ticks passed; latch the fault of one that did not go on.

    Such a one is not believed either, until reset, where it is far beyond: that is no reason to brake.
    """
    if not told > _SAME_TIME_TICKS:
        state.clock.distrusted = 1
        if state.fault == 0:
            state.fault = CLOCK
        return False
    return state.clock.distrusted == 0 or told <= OVERDUE_TICKS


@compiled
def _accept(state: Record, m: Record, dt: float, since: float, timed: bool) -> None:
    """Take the measurement over; `timed` where its clock told how many ticks passed.

    A clock that stands or stutters is counted on, one that was set anew goes on from there.
    """
    clock, arm = state.clock, state.arm
    if state.started == 0:
        clock.pace, clock.pace_variance = 1.0, PACE_UNKNOWN
    elif timed:
        clock.pace += 0.1 * (min(since / (clock.bridged + 1.0), clock.pace + 1.0) - clock.pace)
    elif clock.bridged == 0:
        learn_pace(clock, m, dt)
    clock.elapsed = min(max(since - clock.since, 0.0), BRIDGE_TICKS + 1.0)
    if clock.bridged > 0 or since > OVERDUE_TICKS:
        clock.at_rest = 0  # a brake that holds a place that was predicted lets go of it
    disbelieved = not timed and m.has_time != 0 and clock.has_time != 0
    told = _ticks_told(clock, m, dt) if disbelieved else since
    clock.offset = since - told if abs(told) <= OVERDUE_TICKS else 0.0
    clock.since, clock.bridged = since, 0
    arm.q[:], arm.qd[:] = m.q, m.qd
    clock.q_good[:], clock.qd_good[:] = m.q, m.qd
    clock.time, clock.has_time = m.time, m.has_time
    arm.has_wrench = 1 if m.has_wrench != 0 and all_usable(m.wrench_ee) else 0
    if arm.has_wrench != 0:
        arm.wrench_ee[:] = m.wrench_ee
    arm.has_torque = 1 if m.has_torque != 0 and all_usable(m.torque) else 0
    if arm.has_torque != 0:
        arm.torque[:] = m.torque
    arm.has_base = 1 if m.has_base != 0 and all_usable(m.wrench_base) else 0
    if arm.has_base != 0:
        arm.wrench_base[:] = m.wrench_base
    elif m.has_base != 0 and state.fault == 0:
        state.fault = BAD_BASE


@compiled
def _correct_torque(arm: Record, known: Record) -> None:
    """Take off the measured torque what the sensors are known to show beside it, at the velocity of now."""
    beside = stack_vector(arm.q.shape[0])
    joint_drag_into(known.sensor_friction, known.sensor_drag, arm.qd, beside)
    for i in range(arm.q.shape[0]):
        arm.torque[i] -= beside[i]


@compiled
def set_step(step: Record, one_tick: Record, ticks: float) -> None:
    """Resolve what gains and rates come to over so many ticks.

    Args:
        step: `step_dtype` record; set.
        one_tick: the same of one tick.
        ticks: that passed.
    """
    step.ticks, step.dt = ticks, ticks * one_tick.dt
    step.detection_filter_gain = _over(one_tick.detection_filter_gain, ticks)
    step.compensation_filter_gain = _over(one_tick.compensation_filter_gain, ticks)
    step.lowpass_gain = _over(one_tick.lowpass_gain, ticks)
    step.full_filter_gain, step.full_lowpass_gain = step.detection_filter_gain, step.lowpass_gain
    step.recover_gain = _over(one_tick.recover_gain, ticks)
    step.probe_gain = _over(one_tick.probe_gain, ticks)
    step.reject_recover_gain = _over(one_tick.reject_recover_gain, ticks)
    step.tool_memory_gain = _over(one_tick.tool_memory_gain, ticks)
    step.torque_step = one_tick.torque_step * min(ticks, 1.0)


@compiled
def narrow_band(step: Record, bandwidth: float) -> None:
    """Let what detects take in so much less: its filters as if only a fraction of the time had passed."""
    if bandwidth < 1.0:
        step.detection_filter_gain = _over(step.full_filter_gain, bandwidth)
        step.lowpass_gain = _over(step.full_lowpass_gain, bandwidth)


@compiled
def _over(gain: float, ticks: float) -> float:
    """Return the fraction of a step that a first-order filter takes up in so many ticks, from that of one."""
    return gain if ticks == 1.0 else 1.0 - (1.0 - gain) ** ticks
