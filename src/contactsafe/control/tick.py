"""One control tick: measurement and target in, torque out. Nothing else in this package computes a torque."""

import math

from contactsafe.control.braking import brake_into, braking_fraction
from contactsafe.control.clock import (
    BRIDGE_TICKS,
    all_usable,
    is_usable,
    receive,
    set_step,
    stop_late_target,
    stop_torque,
)
from contactsafe.control.damping import (
    braking_limit,
    joint_damping_limits,
    loosen_limits,
    scale_damping_into,
    task_damping_into,
)
from contactsafe.control.estimate import (
    correct_gravity,
    identify_link_masses,
    observe,
    separate_tool_wrench,
    set_thresholds,
    start,
)
from contactsafe.control.laws import (
    contact_nullspace,
    damping_wrench,
    observer_step,
    push_along,
    stiffness_wrench,
    task_error,
    task_inertia,
    task_nullspace,
    tool_share,
)
from contactsafe.control.limits import (
    joint_excess,
    joint_stop_gains,
    joint_stop_torque,
    limit_torque,
    passive_step,
    power_limit,
    predict_velocity,
)
from contactsafe.control.load import identify_payload, reset_payload_estimate, take_off_payload
from contactsafe.control.records import (
    BAD_GAIN,
    BAD_MEASUREMENT,
    BAD_QUATERNION,
    BAD_TARGET,
    FREE,
    LIMITED_BY_CONTACT,
    LIMITED_BY_ENERGY,
    LIMITED_BY_LOAD,
    LIMITED_BY_RANGE,
    LIMITED_BY_RATE,
    LIMITED_BY_TOOL_FORCE,
    MISSING,
    NO_TORQUE,
    RUNAWAY,
)
from contactsafe.control.supervisor import supervise
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, matmul, matvec_t_into, shorten
from contactsafe.core.stack import stack_vector
from contactsafe.robot.dynamics import update_dynamics
from contactsafe.robot.friction import joint_friction_into

_WHOLE = 0.99
"""A share of the task this large leaves nothing out that anyone would notice."""


@compiled(nogil=True)
def control_tick(c):
    """Run one tick of a `controller_dtype` record in place: reads `measurement` and `target`, writes `output`.

    Order: measurement and time, nominal dynamics, observer, supervisor, weighing, law, push bound, joint stops, energy,
    speed, friction, limits. Bad numbers never raise: they are bridged, or the last good target holds, and `fault` says
    why.
    """
    state, usable = c.state, is_usable(c)
    if not usable:
        _latch(state, BAD_MEASUREMENT)
        if state.started == 0:
            _wait(c)
            return
    receive(c, usable)
    _accept_target(c)
    update_dynamics(c.handle, state.q, state.qd, c.dynamics)
    take_off_payload(c)
    correct_gravity(c)
    if state.started == 0:
        start(c)
        reset_payload_estimate(state)
    stop_late_target(c)
    Lambda, J_M_inv = task_inertia(
        c.dynamics.J, c.dynamics.M_inv, c.params.manipulability_floor, c.params.manipulability_damping
    )
    J_bar = matmul(J_M_inv.T, Lambda)
    set_step(c, min(state.since, BRIDGE_TICKS + 1.0))
    observe(c)
    if state.bridged == 0:
        set_thresholds(c)
        separate_tool_wrench(c, J_bar)
        supervise(c)
        identify_link_masses(c)
        identify_payload(c)
        state.turn = (state.turn + 1) % state.tau.shape[0]
        _watch_speed(c)
        state.since = 0.0
    set_step(c, state.elapsed)
    tau = _law(c, Lambda, J_bar)
    if state.braking != 0:
        tau = stop_torque(c) + c.dynamics.c + c.dynamics.g
    _finish(c, tau)


@compiled(nogil=True)
def tick_at(controllers, i):
    """Run `control_tick` on one of an array of records: Python hands over an array far faster than a record."""
    control_tick(controllers[i])


@compiled
def _latch(state, fault):
    if state.fault == 0:
        state.fault = fault


@compiled
def _wait(c):
    """Repeat the torque that reset found until the first usable measurement; after 20 ticks go over to gravity."""
    state = c.state
    state.bridged += 1
    if state.bridged > BRIDGE_TICKS:
        state.fault, state.braking = MISSING, 1
        tau = c.dynamics.g.copy()
        limit_torque(tau, state.tau, c.params.tau_max, c.params.torque_step, c.dynamics.M_inv)
        state.tau[:] = tau
    c.output.torque[:] = state.tau
    c.output.fault, c.output.bridged, c.output.braked = state.fault, state.bridged, state.braking


@compiled
def _target_fault(target, params):
    usable = all_usable(target.position) and all_usable(target.quat) and all_usable(target.q_posture)
    if not (usable and all_usable(target.K_task) and all_usable(target.D_task)):
        return BAD_TARGET
    if abs(dot(target.quat, target.quat) - 1.0) > 2e-3:
        return BAD_QUATERNION
    for i in range(6):
        K, D = target.K_task[i], target.D_task[i]
        if K < params.stiffness_min or K > params.stiffness_max or D < params.damping_min or D > params.damping_max:
            return BAD_GAIN
    return 0


@compiled
def _accept_target(c):
    """Take the target over where it is sound; latch the reason where it is not."""
    if c.target.kept != 0:
        return
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
    held.q_posture[:] = c.target.q_posture


@compiled
def _watch_speed(c):
    """Latch a fault where a joint stays beyond its speed limit for longer than braking it takes."""
    state, params = c.state, c.params
    for i in range(state.overspeed_s.shape[0]):
        excess = abs(state.qd[i]) - params.runaway_speed[i]
        if excess <= 0.0:
            state.overspeed_s[i] = 0.0
            continue
        state.overspeed_s[i] += state.step.dt
        if state.overspeed_s[i] > params.reversal_s[i] + excess * c.dynamics.M[i, i] / params.tau_max[i]:
            state.fault, state.runaway = RUNAWAY, 1


@compiled
def _law(c, Lambda, J_bar):
    """Free law (17) or contact-aware law (18), (21), (22), with the push bounded; tau_m as a model asks, (n,), N m.

    What pulls towards a target (stiffness, posture) is kept apart from what damps: the task's share in force, 1 in
    peace, scales the one and never the other.
    """
    state, dynamics, params, target = c.state, c.dynamics, c.params, c.state.target
    n = state.q.shape[0]
    passive_step(
        state.K_task,
        state.D_task,
        target.K_task,
        target.D_task,
        state.step.dt,
        params.damping_min,
        params.passive_gains != 0,
    )
    error = task_error(target.position, target.quat, dynamics.position, dynamics.rotation)
    c.output.error[:] = error
    F_spring = stiffness_wrench(
        Lambda, error, state.K_task, params.task_acceleration_max_m_s2, params.task_acceleration_max_rad_s2
    )
    D_task = task_damping_into(state.K_task, state.D_task, params.loop_delay_s, stack_vector(6))
    F_damping = damping_wrench(Lambda, dynamics.velocity, dynamics.Jdot_qd, D_task)
    _limit_damping(c, D_task.max())
    N_t = task_nullspace(dynamics.J, J_bar)
    N_ct = N_t if state.mode == FREE else contact_nullspace(N_t, dynamics.M_inv, state.direction)
    tau_spring, tau_damping = stack_vector(n), stack_vector(n)
    _posture_into(c, tau_spring, tau_damping)
    of_task, of_posture = stack_vector(n), stack_vector(n)
    pull = matvec_t_into(dynamics.J, F_spring, of_task) + matvec_t_into(N_ct, tau_spring, of_posture)
    damping = matvec_t_into(dynamics.J, F_damping, of_task) + matvec_t_into(N_ct, tau_damping, of_posture)
    observer_step(state.tool_force, state.step.probe_gain, _tool_force_into(c, J_bar, stack_vector(6)))
    share = tool_share(F_spring, state.tool_force, params.tool_contact_n, params.tool_force_limit_n)
    reason = LIMITED_BY_TOOL_FORCE if share < 1.0 else 0
    if state.mode == FREE:
        c.output.push_nm, c.output.push_limit_nm = 0.0, math.inf
        _follow_scale(state, params, share, reason)
        tau = state.task_scale * pull + damping + state.unweighed
    else:
        F_arm = matvec_t_into(J_bar, state.arm_torque, stack_vector(6))
        disturbance = matvec_t_into(dynamics.J, F_arm, of_task)
        tau = _contact_law(c, pull, damping, disturbance, N_t - N_ct, share, reason)
    return tau + dynamics.c + dynamics.g


@compiled
def _limit_damping(c, D_task):
    """Give every joint the share of its dampers that its inertia takes beside a damping of the task, 1/s."""
    state, params = c.state, c.params
    state.task_damping = D_task
    joint_damping_limits(c.dynamics.M_inv, params.damping_rate - D_task, state.damping_limit)
    state.joint_damping[:] = params.D_posture
    if state.mode != FREE:
        for i in range(state.joint_damping.shape[0]):
            state.joint_damping[i] = max(params.D_posture[i], params.null_damping) + params.contact_damping
    if (state.joint_damping > state.damping_limit).any():
        loosen_limits(c.dynamics.M_inv, params.damping_rate - D_task, state.damping_limit)
    scale_damping_into(state.joint_damping, state.damping_limit, state.damping_scale)
    for i in range(state.joint_damping.shape[0]):
        state.joint_damping[i] *= state.damping_scale[i]


@compiled
def _posture_into(c, tau_spring, tau_damping):
    """Fill what pulls to the posture and what damps it, K2 (q_d − q) and −D2 q̇, (15), (n,) each, N m."""
    state, params = c.state, c.params
    _follow_posture(state, params)
    for i in range(tau_spring.shape[0]):
        tau_spring[i] = state.target.q_posture[i] - state.q[i]
    shorten(tau_spring, params.posture_error_max_rad)
    for i in range(tau_spring.shape[0]):
        D = state.damping_scale[i] * params.D_posture[i]
        tau_spring[i] *= state.posture_scale * min(params.K_posture[i], D / (2.0 * params.loop_delay_s))
        tau_damping[i] = -D * state.qd[i]


@compiled
def _tool_force_into(c, J_bar, wrench):
    """Force of the environment on the tool, (3,), N: measured, or without a sensor what the residual says, J#ᵀ r."""
    if c.state.has_wrench != 0:
        wrench[:] = c.state.wrench_ee
    else:
        matvec_t_into(J_bar, c.state.residual_fast, wrench)
    return wrench[:3]


@compiled
def _follow_scale(state, params, wanted, reason):
    """Let the task's share fall at once and come back slowly, fast where something pushes the arm; say what took it."""
    if wanted < state.task_scale:
        state.task_scale, state.scale_reason = wanted, reason
    else:
        back = state.step.recover_gain if state.holding == 0 else state.step.reject_recover_gain
        state.task_scale += back * (wanted - state.task_scale)
    if state.task_scale > _WHOLE:
        state.scale_reason = reason


@compiled
def _follow_posture(state, params):
    """Let the posture's stiffness go in contact and come back slowly: (21) alone gives it back at once."""
    if state.mode == FREE:
        state.posture_scale += state.step.recover_gain * (1.0 - state.posture_scale)
    else:
        state.posture_scale = params.posture_in_contact


@compiled
def _contact_law(c, pull, damping, task_disturbance, removed, share, reason):
    """Jᵀ (F − J#ᵀ residual) + N_ctᵀ Γ_pose, (18), (21), (22), and what keeps it gentle.

    Damping stays in the null-space direction that the contact takes out and in all joints; motion into an obstacle is
    braked along the contact's direction; and the command never pushes along it harder than the bound in force: first
    the compensation gives way, then the pull of the task as a whole, last the damping.
    """
    state, params = c.state, c.params
    qd, direction, M_inv = c.state.qd, c.state.direction, c.dynamics.M_inv
    limit = _push_limit(c)
    n = qd.shape[0]
    shared, in_null = stack_vector(n), stack_vector(n)
    for i in range(n):
        shared[i] = state.damping_scale[i] * qd[i]
    matvec_t_into(removed, shared, in_null)
    for i in range(n):
        damping[i] -= params.null_damping * in_null[i]
        damping[i] -= params.contact_damping * state.damping_scale[i] * qd[i]
    compensation = -task_disturbance
    push = push_along(direction, M_inv, compensation)
    if push > limit:
        compensation *= limit / push
    left = limit - max(min(push, limit), 0.0)
    pull_push = push_along(direction, M_inv, pull)
    if pull_push > 0.0 and left / pull_push < share:
        share, reason = left / pull_push, LIMITED_BY_CONTACT
    _follow_scale(state, params, share, reason)
    tau = state.task_scale * pull + compensation + damping + state.unweighed
    c.output.push_nm, c.output.push_limit_nm = push + pull_push, limit
    push = push_along(direction, M_inv, tau)
    if push > limit:
        tau += (push - limit) * direction
    if state.holding == 0:
        # After the bound, or the task would use up what the brake frees.
        approach = min(dot(direction, qd), 0.0)
        if approach < 0.0 and params.approach_damping > 0.0:
            most = braking_limit(direction, c.dynamics.M, state.joint_damping, params.braking_rate - state.task_damping)
            tau -= min(params.approach_damping, most) * approach * direction
    return tau


@compiled
def _push_limit(c):
    """Bound in force, N m: a torque, and what a force limit comes to with the lever arm that the link suggests."""
    params, state = c.params, c.state
    gentle = min(params.contact_torque_limit_comply_nm, params.contact_force_limit_comply_n * state.lever)
    firm = max(
        state.meet_n * state.lever_most, min(state.hold_nm, params.contact_force_limit_reject_n * state.lever_most)
    )
    return max(gentle, min(firm, params.contact_torque_limit_reject_nm))


@compiled
def _refuse_unusable(state, tau):
    """Repeat the last command where a law gave none that is finite."""
    if not all_usable(tau):
        _latch(state, NO_TORQUE)
        tau[:] = state.tau


@compiled
def _stop_joints(c, tau_net, speed, ahead):
    """Keep joints in their range and below their speed limits, in place; tell whether that took anything."""
    state, dynamics, params = c.state, c.dynamics, c.params
    q, qd = state.q, state.qd
    n = q.shape[0]
    excess, intrusion = stack_vector(n), stack_vector(n)
    if not joint_excess(
        q, qd, speed, ahead, params.q_min, params.q_max, params.qd_max, params.joint_margin, params.joint_deceleration,
        excess, intrusion,
    ):  # fmt: skip
        return False
    brake, spring, drag = stack_vector(n), stack_vector(n), stack_vector(n)
    rate = params.braking_rate - state.task_damping
    joint_stop_gains(
        dynamics.M, state.joint_damping, rate, excess, intrusion, params.joint_brake,
        params.joint_stop_stiffness, params.loop_delay_s, brake, spring, drag,
    )  # fmt: skip
    joint_stop_torque(tau_net, dynamics.M_inv, qd, excess, intrusion, params.joint_margin, brake, spring, drag)
    return True


@compiled
def _slow_down(c, tau, speed):
    """Brake the whole arm in place of the command as far as it is too fast; tell whether that took anything.

    Where it has run away nothing but that is left to do.
    """
    state, dynamics, params = c.state, c.dynamics, c.params
    share = 1.0
    if state.runaway == 0:
        share = braking_fraction(state.qd, speed, dynamics.c, params.runaway_speed, params.tau_max)
    if share == 0.0:
        return False
    brake, torque_rate = stack_vector(tau.shape[0]), params.torque_step / params.dt
    brake_into(dynamics.M, dynamics.M_inv, state.qd, params.tau_max, torque_rate, params.damping_rate, brake)
    for i in range(tau.shape[0]):
        tau[i] += share * (brake[i] + dynamics.c[i] - tau[i])
    return True


@compiled
def _finish(c, tau):
    """Add friction compensation and joint stops, apply the limits, remember and report."""
    state, dynamics, params, out = c.state, c.dynamics, c.params, c.output
    qd, step = state.qd, state.step
    _refuse_unusable(state, tau)
    limited_by = state.scale_reason if state.task_scale < 1.0 else 0
    if state.loaded != 0 and state.task_scale < _WHOLE:
        limited_by |= LIMITED_BY_LOAD
    # Joints are stopped from what the motors can do, not from what is wanted of them.
    clipped = limit_torque(tau, state.tau, params.tau_max, math.inf, dynamics.M_inv)
    tau -= dynamics.g + dynamics.c
    dt, speed, ahead = max(step.dt, params.dt), stack_vector(tau.shape[0]), stack_vector(tau.shape[0])
    predict_velocity(qd, dynamics.M_inv, state.momentum_rate, params.torque_step, dt, speed, ahead)
    if _stop_joints(c, tau, speed, ahead):
        limited_by |= LIMITED_BY_RANGE
    tau += dynamics.c
    if power_limit(tau, dynamics.M, qd, state.tank_j, params.tank_power_w, params.tank_s):
        limited_by |= LIMITED_BY_ENERGY
    if _slow_down(c, tau, speed):
        limited_by |= LIMITED_BY_RANGE
    tau += dynamics.g
    state.friction[:] = 0.0
    if params.friction_compensation != 0:
        tau += joint_friction_into(params.friction, qd, state.friction)
    _refuse_unusable(state, tau)
    clipped = limit_torque(tau, state.tau, params.tau_max, step.torque_step, dynamics.M_inv) or clipped
    out.limited_by = limited_by | LIMITED_BY_RATE if clipped else limited_by
    state.tau[:] = tau
    given = dot(tau - state.friction - dynamics.g, qd)
    state.tank_j = min(state.tank_j + step.dt * (params.tank_power_w - given), params.tank_j)
    out.torque[:] = tau
    out.residual[:] = state.residual
    out.residual_fast[:] = state.residual_fast
    out.position[:] = dynamics.position
    out.rotation[:] = dynamics.rotation
    out.velocity[:] = dynamics.velocity
    out.mode, out.holding, out.fault = state.mode, state.holding, state.fault
    out.target_late = state.target_late
    out.braked = 1 if state.braking != 0 or state.runaway != 0 else 0
