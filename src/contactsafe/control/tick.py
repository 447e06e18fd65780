"""One control tick: measurement and target in, torque out. Nothing else in this package computes a torque."""

import math

import numpy as np

from contactsafe.compiled import compiled
from contactsafe.control.laws import (
    contact_nullspace,
    damping_wrench,
    is_pushed,
    joint_stop_torque,
    limit_torque,
    momentum,
    observer_step,
    push_along,
    stiffness_wrench,
    task_error,
    task_inertia,
    task_nullspace,
    tool_share,
)
from contactsafe.control.records import CONTACT, FREE
from contactsafe.robot.contact import best_point, contact_lever, skin_torque
from contactsafe.robot.dynamics import update_dynamics
from contactsafe.robot.friction import joint_friction
from contactsafe.robot.linalg import dot, matmul, matvec, matvec_t

_BAD_MEASUREMENT, _BAD_TARGET, _BAD_QUATERNION, _BAD_GAIN, _LOST = 1, 2, 3, 4, 5
_LOST_AFTER_TICKS = 20

_POINTS_A_TICK = 60
"""Points of the skin that are searched for the contact in one tick."""

_LEAST_LEVER = 0.03
"""No contact counts as nearer to all axes than this, m: its force would be anybody's guess."""

_ABSURD = 1e6
"""No number of a measurement or target reaches this, in SI units: a broken sensor or a loop that has run away."""


@compiled(nogil=True)
def control_tick(c):
    """Run one tick of a `controller_dtype` record in place: reads `measurement` and `target`, writes `output`.

    Order: refuse bad numbers, nominal dynamics, observer, supervisor, law, push bound, friction and joint stops,
    limits. Bad numbers never raise: the last good target or torque holds and `fault` says why.
    """
    if not _measurement_is_usable(c.measurement):
        _tick_without_measurement(c)
        return
    _accept_target(c)
    update_dynamics(c.handle, c.measurement.q, c.measurement.qd, c.dynamics)
    if c.state.started == 0:
        _start(c)
    _observe(c)
    c.state.bad_ticks = 0
    _supervise(c)
    tau = _law(c)
    _finish(c, tau)


@compiled(nogil=True)
def tick_at(controllers, i):
    """Run `control_tick` on one of an array of records: Python hands over an array far faster than a record."""
    control_tick(controllers[i])


@compiled
def _all_usable(x):
    for i in range(x.shape[0]):
        if not abs(x[i]) < _ABSURD:  # NaN as well
            return False
    return True


@compiled
def _measurement_is_usable(m):
    wrench_ok = m.has_wrench == 0 or _all_usable(m.wrench_ee)
    return wrench_ok and _all_usable(m.q) and _all_usable(m.qd)


@compiled
def _latch(state, fault):
    if state.fault == 0:
        state.fault = fault


@compiled
def _tick_without_measurement(c):
    """Repeat the last torque, as the robot itself does for a lost packet; after 20 ticks fall back to gravity."""
    state = c.state
    _latch(state, _BAD_MEASUREMENT)
    state.bad_ticks += 1
    if state.bad_ticks > _LOST_AFTER_TICKS:
        state.fault = _LOST
        tau = c.dynamics.g.copy()
        limit_torque(tau, state.tau, c.params.tau_max, c.params.torque_step)
        state.tau[:] = tau
    c.output.torque[:] = state.tau
    c.output.fault = state.fault


@compiled
def _target_fault(target, params):
    usable = _all_usable(target.position) and _all_usable(target.quat) and _all_usable(target.q_pose)
    if not (usable and _all_usable(target.K_task) and _all_usable(target.D_task)):
        return _BAD_TARGET
    if abs(dot(target.quat, target.quat) - 1.0) > 2e-3:
        return _BAD_QUATERNION
    for i in range(6):
        K, D = target.K_task[i], target.D_task[i]
        if K < params.stiffness_min or K > params.stiffness_max or D < params.damping_min or D > params.damping_max:
            return _BAD_GAIN
    return 0


@compiled
def _accept_target(c):
    """Take the target over where it is sound; latch the reason where it is not."""
    fault = _target_fault(c.target, c.params)
    if fault != 0:
        _latch(c.state, fault)
        return
    held = c.state.target
    norm = math.sqrt(dot(c.target.quat, c.target.quat))
    for i in range(4):
        held.quat[i] = c.target.quat[i] / norm
    held.position[:] = c.target.position
    held.K_task[:] = c.target.K_task
    held.D_task[:] = c.target.D_task
    held.q_pose[:] = c.target.q_pose


@compiled
def _start(c):
    """Begin at rest: momentum as measured, command at gravity, so that nothing jumps."""
    state, dynamics = c.state, c.dynamics
    state.started = 1
    state.task_share = 1.0
    state.momentum[:] = momentum(dynamics.M, c.measurement.qd)
    for i in range(state.beta.shape[0]):
        state.beta[i] = dynamics.g[i] - dynamics.CT_qd[i]
        # No torque was sent yet: whatever balanced the arm until now was g, so the first raw external torque is zero.
        state.tau[i] = state.beta[i]


@compiled
def _observe(c):
    """Raw external torque of the last tick, two observers of it, a low-pass behind each; (10)-(14).

    After unusable measurements it is the mean since the last good one, during which the torque was repeated.
    """
    state, dynamics, params = c.state, c.dynamics, c.params
    n = state.tau.shape[0]
    since = params.dt * (1 + state.bad_ticks)
    known = state.bad_ticks <= _LOST_AFTER_TICKS
    p = momentum(dynamics.M, c.measurement.qd)
    tau_external = np.empty(n)
    for i in range(n):
        beta = dynamics.g[i] - dynamics.CT_qd[i]
        applied = state.tau[i] - state.friction[i] - 0.5 * (beta + state.beta[i])
        tau_external[i] = (p[i] - state.momentum[i]) / since - applied
        state.beta[i] = beta
        state.momentum[i] = p[i]
    if not known:
        return
    if c.measurement.has_wrench != 0 and params.cancel_tool_wrench != 0:
        tau_tool = matvec_t(dynamics.J, c.measurement.wrench_ee)
        for i in range(n):
            tau_external[i] -= tau_tool[i]
    observer_step(state.observed, params.observer_share, tau_external)
    observer_step(state.observed_trigger, params.trigger_share, tau_external)
    observer_step(state.residual, params.lowpass_share, state.observed)
    observer_step(state.residual_trigger, params.lowpass_share, state.observed_trigger)


@compiled
def _link_in_contact(residual, threshold):
    """Give the furthest joint from the base whose residual exceeds the threshold, 1 … n; 0 for none."""
    for i in range(residual.shape[0] - 1, -1, -1):
        if abs(residual[i]) > threshold:
            return i + 1
    return 0


@compiled
def _supervise(c):
    """Choose the mode, with dwell and release; remember the contact's direction; tell pusher from obstacle."""
    state, params = c.state, c.params
    link = _link_in_contact(state.residual_trigger, params.residual_threshold)
    state.mode_ticks += 1
    state.quiet_ticks = 0 if link != 0 else state.quiet_ticks + 1
    if state.mode == FREE:
        if link != 0 and params.contact_aware != 0:
            _enter(state, CONTACT)
    elif state.mode_ticks >= params.dwell_ticks and state.quiet_ticks > params.release_ticks:
        _enter(state, FREE)
    if state.mode == CONTACT:
        if link != 0:
            state.direction[:] = state.residual_trigger / math.sqrt(dot(state.residual_trigger, state.residual_trigger))
            _locate(c, link)
    _watch_push(c)
    c.output.link = 0 if link == 0 else state.contact_link


@compiled
def _locate(c, link):
    """Look for the contact on the skin, a part of it each tick; until the first search is through, judge by the link."""
    state = c.state
    if state.contact_link == 0:
        state.contact_link = link
        state.lever = contact_lever(c.handle, link, state.direction)
        state.lever_most = state.lever
    if state.search_at == 0:
        state.search_point, state.search_fit = -1, 0.0
    stop = min(state.search_at + _POINTS_A_TICK, c.handle.skin_points)
    torque = np.empty(state.direction.shape[0])
    state.search_point, state.search_fit = best_point(
        c.handle, state.search_at, stop, state.direction, torque, state.search_point, state.search_fit
    )
    state.search_at = stop
    if stop == c.handle.skin_points:
        state.search_at = 0
        if state.search_point >= 0:
            state.contact_link = skin_torque(c.handle, state.search_point, torque)
            state.lever = max(math.sqrt(dot(torque, torque)), _LEAST_LEVER)
            state.lever_most = max(state.lever, contact_lever(c.handle, state.contact_link, state.direction))


@compiled
def _enter(state, mode):
    state.mode, state.mode_ticks = mode, 0
    state.moved_rad, state.moved_smooth_rad, state.torque_smooth_nm, state.reference_nm = 0.0, 0.0, 0.0, 0.0
    state.contact_link, state.search_at = 0, 0
    state.judge_rad, state.holding, state.hold_s, state.hold_nm = math.inf, 0, 0.0, math.nan


@compiled
def _watch_push(c):
    """Tell what pushes the arm from what is in its way: give way a little, and see whether the torque falls.

    Torque and velocity pass the same filters, or the torque's lag would look like a pusher.
    """
    state, params = c.state, c.params
    observer_step(state.velocity_observed, params.trigger_share, c.measurement.qd)
    observer_step(state.velocity_seen, params.lowpass_share, state.velocity_observed)
    if state.mode != CONTACT:
        return
    lever = state.lever
    if math.isnan(state.hold_nm):
        state.hold_nm = params.push_meet_n * lever
    state.moved_rad += params.dt * dot(state.direction, state.velocity_seen)
    torque = dot(state.direction, state.residual_trigger)
    state.torque_smooth_nm += params.probe_share * (torque - state.torque_smooth_nm)
    state.moved_smooth_rad += params.probe_share * (state.moved_rad - state.moved_smooth_rad)
    moved, torque = state.moved_smooth_rad, state.torque_smooth_nm
    step = params.probe_m / lever
    if moved <= 0.0:  # the arm moves into it
        state.moved_rad, state.moved_smooth_rad, state.reference_nm = min(state.moved_rad, 0.0), 0.0, torque
    state.judge_rad = min(state.judge_rad, moved + step)
    if moved >= state.judge_rad:
        state.judge_rad = moved + step
        if is_pushed(state.reference_nm - torque, moved, lever, params.pusher_stiffness):
            state.holding = 1
            state.hold_s = max(2.0 * state.hold_s, params.hold_s)
            state.hold_nm = params.hold_margin * torque
        else:
            state.holding, state.hold_s, state.hold_nm = 0, 0.0, 0.0
    state.hold_nm -= params.dt / max(state.hold_s, params.meet_s) * state.hold_nm


@compiled
def _law(c):
    """Free law (17) or contact-aware law (18), (21), (22), with the push bounded; tau_m as a model asks, (n,), N m.

    What pulls towards a target (stiffness, posture) is kept apart from what damps: the task's share in force, 1 in
    peace, scales the one and never the other.
    """
    state, dynamics, params, target = c.state, c.dynamics, c.params, c.state.target
    q, qd = c.measurement.q, c.measurement.qd
    Lambda, J_M_inv = task_inertia(
        dynamics.J, dynamics.M_inv, params.manipulability_floor, params.manipulability_damping
    )
    J_bar = matmul(J_M_inv.T, Lambda)
    error = task_error(target.position, target.quat, dynamics.position, dynamics.rotation)
    F_spring = stiffness_wrench(Lambda, error, target.K_task)
    F_damping = damping_wrench(Lambda, dynamics.velocity, dynamics.Jdot_qd, target.D_task)
    N_t = task_nullspace(dynamics.J, J_bar)
    N_ct = N_t if state.mode == FREE else contact_nullspace(N_t, dynamics.M_inv, state.direction)
    pull = matvec_t(dynamics.J, F_spring) + matvec_t(N_ct, params.K_pose * (target.q_pose - q))
    damping = matvec_t(dynamics.J, F_damping) - matvec_t(N_ct, params.D_pose * qd)
    c.output.error[:] = error
    share = tool_share(F_spring, _tool_force(c, J_bar), params.tool_contact_n, params.push_tool_n)
    if state.mode == FREE:
        c.output.push_nm, c.output.push_limit_nm = 0.0, math.inf
        _follow_share(state, params, share)
        tau = state.task_share * pull + damping
    else:
        tau = _contact_law(c, pull, damping, matvec_t(dynamics.J, matvec_t(J_bar, state.residual)), N_t - N_ct, share)
    return tau + dynamics.c + dynamics.g


@compiled
def _tool_force(c, J_bar):
    """Force of the environment on the tool, (3,), N: measured, or without a sensor what the residual says, J#ᵀ r."""
    if c.measurement.has_wrench != 0:
        return c.measurement.wrench_ee[:3]
    return matvec_t(J_bar, c.state.residual_trigger)[:3]


@compiled
def _follow_share(state, params, wanted):
    """Let the task's share fall at once and come back slowly; fast where something pushes the arm."""
    if wanted < state.task_share:
        state.task_share = wanted
    else:
        back = params.recover_share if state.holding == 0 else params.hold_share
        state.task_share += back * (wanted - state.task_share)


@compiled
def _contact_law(c, pull, damping, task_disturbance, removed, share):
    """Jᵀ (F − J#ᵀ residual) + N_ctᵀ Γ_pose, (18), (21), (22), and what keeps it gentle.

    Damping stays in the null-space direction that the contact takes out and in all joints; motion into an obstacle is
    braked along the contact's direction; and the command never pushes along it harder than the bound in force: first
    the compensation gives way, then the pull of the task as a whole, last the damping.
    """
    state, dynamics, params = c.state, c.dynamics, c.params
    qd, direction, M_inv = c.measurement.qd, c.state.direction, c.dynamics.M_inv
    limit = _push_limit(c)
    damping -= params.null_damping * matvec_t(removed, qd)
    damping -= params.contact_damping * qd
    compensation = -task_disturbance
    push = push_along(direction, M_inv, compensation)
    if push > limit:
        compensation *= limit / push
    left = limit - max(min(push, limit), 0.0)
    pull_push = push_along(direction, M_inv, pull)
    if pull_push > 0.0:
        share = min(share, left / pull_push)
    _follow_share(state, params, share)
    tau = state.task_share * pull + compensation + damping
    c.output.push_nm, c.output.push_limit_nm = push + pull_push, limit
    push = push_along(direction, M_inv, tau)
    if push > limit:
        tau += (push - limit) * direction
    if state.holding == 0:
        # After the bound, or the task would use up what the brake frees.
        tau -= params.approach_damping * min(dot(direction, qd), 0.0) * direction
    return tau


@compiled
def _push_limit(c):
    """Bound in force, N m: a torque, and what a force limit comes to with the lever arm that the link suggests."""
    params, lever = c.params, c.state.lever
    limit = min(params.push_yield_nm, params.push_yield_n * lever)
    return max(limit, min(c.state.hold_nm, params.push_hold_nm, params.push_hold_n * c.state.lever_most))


@compiled
def _finish(c, tau):
    """Add friction compensation and joint stops, apply the limits, remember and report."""
    state, dynamics, params, out = c.state, c.dynamics, c.params, c.output
    q, qd = c.measurement.q, c.measurement.qd
    tau += joint_stop_torque(
        q, qd, params.q_min, params.q_max, params.joint_margin, params.joint_stop_stiffness, params.joint_stop_damping
    )
    friction = np.zeros(q.shape[0])
    if params.friction_compensation != 0:
        friction = joint_friction(params.friction, qd)
        tau += friction
    out.limited = 1 if limit_torque(tau, state.tau, params.tau_max, params.torque_step) else 0
    state.tau[:] = tau
    state.friction[:] = friction
    out.torque[:] = tau
    out.residual[:] = state.residual
    out.residual_trigger[:] = state.residual_trigger
    out.position[:] = dynamics.position
    out.rotation[:] = dynamics.rotation
    out.velocity[:] = dynamics.velocity
    out.mode, out.holding, out.fault = state.mode, state.holding, state.fault
