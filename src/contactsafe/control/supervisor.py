"""Which mode the controller is in, where it is touched, and whether something pushes the arm or is in its way."""

import math

import numpy as np

from contactsafe.control.laws import is_pushed, observer_step
from contactsafe.control.records import CONTACT, FREE
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot
from contactsafe.robot.contact import best_point, contact_lever, surface_torque

_POINTS_A_TICK = 20
"""Points of the surface that are searched for the contact in one tick."""

_LEAST_LEVER = 0.03
"""No contact counts as nearer to all axes than this, m: its force would be anybody's guess."""

_CERTAIN = 4.0
"""Once the arm holds, so many times the way that began it must speak for an obstacle to end it."""

_LEVER_GAIN = 0.2
"""Of a newly found lever arm that is taken over at once."""


@compiled
def _link_in_contact(alarm, threshold, share):
    """Give the furthest joint from the base whose torque exceeds a share of its threshold, 1 … n; 0 for none."""
    for i in range(alarm.shape[0] - 1, -1, -1):
        if abs(alarm[i]) > share * threshold[i]:
            return i + 1
    return 0


@compiled
def supervise(c):
    """Choose the mode, with dwell and release; remember the contact's direction; tell pusher from obstacle."""
    state, params = c.state, c.params
    link = _link_in_contact(state.alarm, state.threshold, 1.0)
    left = link if state.mode == FREE else _link_in_contact(state.alarm, state.threshold, params.release_fraction)
    ticks = max(round(state.step.ticks), 1)
    state.mode_ticks += ticks
    state.quiet_ticks = 0 if left != 0 else state.quiet_ticks + ticks
    if state.mode == FREE:
        if link != 0 and params.contact_aware != 0:
            enter(state, CONTACT)
    elif state.mode_ticks >= params.dwell_ticks and state.quiet_ticks > params.release_ticks:
        enter(state, FREE)
    if state.mode == CONTACT and link != 0:
        state.direction[:] = state.arm_torque_fast / _size(state.arm_torque_fast)
        _locate(c, link)
    _watch_push(c)
    c.output.link = state.contact_link if state.mode == CONTACT and state.contact_link != 0 else link


@compiled
def _size(x):
    return max(math.sqrt(dot(x, x)), 1e-9)


@compiled
def _locate(c, link):
    """Look for the contact on the surface: all of it when it is found, later a part each tick.

    Lever arms are smoothed: a contact between two links would be now on the one, now on the other.
    """
    state = c.state
    first = state.contact_link == 0
    points = c.handle.surface_points
    if first or points == 0:
        _take_link(c, link, _longest_lever(c, link), 1.0)
    if state.search_at == 0:
        state.search_point, state.search_fit = -1, 0.0
    stop = points if first else min(state.search_at + _POINTS_A_TICK, points)
    torque = np.empty(state.direction.shape[0])
    state.search_point, state.search_fit = best_point(
        c.handle, state.search_at, stop, state.direction, torque, state.search_point, state.search_fit
    )
    state.search_at = stop % points if points > 0 else 0
    if state.search_at == 0 and state.search_point >= 0:
        found = surface_torque(c.handle, state.search_point, torque)
        _take_link(c, found, _size(torque), 1.0 if first else _LEVER_GAIN)


@compiled
def _longest_lever(c, link):
    """Longest lever arm of the links that may be touched where no sample tells: near its joint a link shows less."""
    lever = 0.0
    for further in range(link, c.state.direction.shape[0] + 1):
        lever = max(lever, contact_lever(c.handle, further, c.state.direction))
    return lever


@compiled
def _take_link(c, link, lever, share):
    state = c.state
    most = max(lever, contact_lever(c.handle, link, state.direction))
    state.contact_link = link
    state.lever += share * (max(lever, _LEAST_LEVER) - state.lever)
    state.lever_most += share * (max(most, _LEAST_LEVER) - state.lever_most)


@compiled
def enter(state, mode):
    """Begin a mode anew."""
    state.mode, state.mode_ticks = mode, 0
    state.displacement_rad, state.displacement_smooth_rad, state.torque_smooth_nm, state.reference_nm = (
        0.0,
        0.0,
        0.0,
        0.0,
    )
    state.contact_link, state.search_at = 0, 0
    state.decide_rad, state.holding, state.hold_s, state.hold_nm, state.meet_n = math.inf, 0, 0.0, 0.0, math.inf


@compiled
def _watch_push(c):
    """Tell what pushes the arm from what is in its way: give way a little, and see whether the torque falls.

    Torque and velocity pass the same filters, or the torque's lag would look like a pusher.
    """
    state, params, step = c.state, c.params, c.state.step
    observer_step(state.velocity_observed, step.detection_filter_gain, state.qd)
    observer_step(state.velocity_seen, step.lowpass_gain, state.velocity_observed)
    if state.mode != CONTACT:
        return
    lever = state.lever
    state.meet_n = min(state.meet_n, params.contact_force_limit_initial_n) * (
        1.0 - step.dt / params.contact_force_limit_decay_s
    )
    state.displacement_rad += step.dt * dot(state.direction, state.velocity_seen)
    torque = dot(state.direction, state.arm_torque_fast)
    state.torque_smooth_nm += step.probe_gain * (torque - state.torque_smooth_nm)
    state.displacement_smooth_rad += step.probe_gain * (state.displacement_rad - state.displacement_smooth_rad)
    moved, torque = state.displacement_smooth_rad, state.torque_smooth_nm
    way = params.probe_m / lever
    if moved <= 0.0:  # the arm moves into it
        state.displacement_rad, state.displacement_smooth_rad, state.reference_nm = (
            state.displacement_rad - moved,
            0.0,
            torque,
        )
        state.decide_rad, moved = way, 0.0
    state.decide_rad = min(state.decide_rad, moved + way)
    if moved >= state.decide_rad:
        state.decide_rad = moved + way
        if is_pushed(state.reference_nm - torque, moved, lever, params.obstacle_stiffness_min):
            fallen = 0.5 * (1.0 + params.reject_margin) * torque
            if state.holding == 0 or state.hold_nm < fallen:  # it gave way because the bound had fallen
                state.hold_s = max(2.0 * state.hold_s, params.hold_s)
            state.holding, state.hold_nm = 1, params.reject_margin * torque
        elif state.holding == 0 or moved >= _CERTAIN * way:
            state.holding, state.hold_s, state.hold_nm, state.meet_n = 0, 0.0, 0.0, 0.0
    if state.holding != 0:
        state.hold_nm *= 1.0 - step.dt / state.hold_s
