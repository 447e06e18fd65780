"""One control tick: measurement and target in, torque out. Nothing else in this package computes a torque.

measurement → observer → detection → isolation → identification → classification → reaction → limits → torque
"""

import math

import numpy as np

from contactsafe.control import contact_bound, reaction
from contactsafe.control.clock import set_step
from contactsafe.control.codes import (
    BAD_MEASUREMENT,
    COMPLY,
    FREE,
    LIMITED_BY_LOAD,
    MISSING,
    NO_TORQUE,
)
from contactsafe.control.detection import GONE_S
from contactsafe.control.estimation import (
    estimate,
    follow_arm,
    latch,
    report_arm,
    report_touch,
    start_estimation,
)
from contactsafe.control.impedance import (
    compose_into,
    follow_gains,
    friction_gain,
    overcome_friction,
    posture_torques_into,
    set_joint_damping,
    task_wrenches,
)
from contactsafe.control.laws import contact_nullspace, task_error, task_inertia, task_nullspace, torque_against_contact
from contactsafe.control.limits import fill_tank, limit_command, limit_torque
from contactsafe.control.plausibility import BRIDGE_TICKS, is_usable
from contactsafe.control.stopping import stop_late_target, stop_torque
from contactsafe.control.target import accept_target
from contactsafe.control.tool_force import follow_tool_force, follow_tool_limit
from contactsafe.control.touch import follow_touch
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import matmul, matvec_t_into
from contactsafe.core.stack import stack_vector


@compiled(nogil=True)
def control_tick(c: Record) -> None:
    """Run one tick of a `controller_dtype` record in place: reads `measurement` and `target`, writes `output`.

    Bad numbers never raise: they are bridged, or the last good target holds, and `fault` says why.
    """
    state, dynamics = c.state, c.dynamics
    usable = is_usable(c.measurement, c.params.arm, state.clock.braking)
    if not usable:
        latch(state, BAD_MEASUREMENT)
        if state.started == 0:
            _wait(c)
            return
    follow_arm(c, usable)
    latch(state, accept_target(state.target, c.target, c.params.impedance))
    if state.started == 0:
        _start(c)
    stop_late_target(state.clock, state.target, c.target.kept, state.arm, dynamics, c.params.clock)
    known = c.params.impedance
    Lambda, J_M_inv = task_inertia(dynamics.J, dynamics.M_inv, known.manipulability_floor, known.manipulability_damping)
    J_bar = matmul(J_M_inv.T, Lambda)
    estimate(c, J_bar)
    set_step(state.step, c.params.one_tick, state.clock.elapsed)
    tau = _law(c, Lambda, J_bar)
    if state.clock.braking != 0:
        tau = stop_torque(state.clock, state.arm, dynamics.M)
    _send(c, tau)
    _feel(c)


@compiled(nogil=True)
def tick_at(controllers: np.ndarray, i: int) -> None:
    """Run `control_tick` on one of an array of records: Python hands over an array far faster than a record."""
    control_tick(controllers[i])


@compiled
def _wait(c: Record) -> None:
    """Repeat the torque that reset found until the first usable measurement; after 20 ticks go over to gravity."""
    state, clock, command = c.state, c.state.clock, c.state.command
    clock.bridged += 1
    if clock.bridged > BRIDGE_TICKS:
        state.fault, clock.braking = MISSING, 1
        tau = c.dynamics.g.copy()
        limit_torque(tau, command.tau, c.params.arm.tau_max, c.params.one_tick.torque_step, c.dynamics.M_inv)
        command.tau[:] = tau
    c.output.torque[:] = command.tau
    c.output.fault, c.output.bridged, c.output.braked = state.fault, clock.bridged, clock.braking


@compiled
def _start(c: Record) -> None:
    """Begin where the arm is, with the command as last sent."""
    state = c.state
    state.reaction.task_scale, state.reaction.posture_scale = 1.0, 1.0
    state.limits.tank_j = c.params.limits.tank_j
    state.impedance.K_task[:] = state.target.K_task
    state.impedance.D_task[:] = state.target.D_task
    start_estimation(c)


@inlined
def _law(c: Record, Lambda: Matrix, J_bar: Matrix) -> Vector:
    """Free law (17) or contact-aware law (18), (21), (22), with bounded contact force; without c and g, (n,), N m."""
    state, dynamics, params, target = c.state, c.dynamics, c.params, c.state.target
    arm, impedance, tool = state.arm, state.impedance, state.tool_wrench
    n = arm.q.shape[0]
    follow_gains(impedance, target, state.step.dt, params.impedance)
    error = task_error(target.position, target.quat, dynamics.position, dynamics.rotation)
    c.output.error[:] = error
    F_spring, F_damping = task_wrenches(impedance, Lambda, error, dynamics, params.clock.loop_delay_s, params.impedance)
    set_joint_damping(impedance, state.mode, dynamics.M_inv, params)
    N_t = task_nullspace(dynamics.J, J_bar)
    N_ct = N_t if state.mode == FREE else contact_nullspace(N_t, dynamics.M_inv, state.isolation.direction)
    reaction.follow_posture_scale(state.reaction, state.mode, state.step.recover_gain, params.reaction)
    elastic_posture, damping_posture = stack_vector(n), stack_vector(n)
    posture_torques_into(
        impedance, arm, target.q_posture, state.reaction.posture_scale, params, elastic_posture, damping_posture
    )
    elastic = compose_into(dynamics.J, F_spring, N_ct, elastic_posture, stack_vector(n))
    if params.impedance.friction_compensation != 0 and state.mode == FREE:
        task = matvec_t_into(dynamics.J, F_spring, stack_vector(n))
        gain = friction_gain(impedance.K_task, impedance.D_task, params.clock.loop_delay_s)
        overcome_friction(elastic, task, arm.qd, gain, params.arm)
    damping = compose_into(dynamics.J, F_damping, N_ct, damping_posture, stack_vector(n))
    follow_tool_force(tool, arm, state.mode, state.observer.residual_fast, J_bar, params.arm, state.step.probe_gain)
    contact_n = params.classification.tool_contact_n
    limit = follow_tool_limit(tool, arm, state.contact_work, contact_n, params.reaction)
    scale, reason = contact_bound.tool_task_scale(F_spring, tool.force, contact_n, limit)
    if state.mode == FREE:
        c.output.contact_command_nm, c.output.contact_limit_nm = 0.0, math.inf
        contact_bound.follow_task_scale(state.reaction, state.mode, scale, reason, state.step)
        return state.reaction.task_scale * elastic + damping - state.link_masses.gravity_correction
    compensation = reaction.compensate_disturbance(dynamics.J, J_bar, tool.arm_torque, stack_vector(n))
    return _contact_law(c, elastic, damping, compensation, N_t, N_ct, scale, reason)


@inlined
def _contact_law(
    c: Record, elastic: Vector, damping: Vector, compensation: Vector, N_t: Matrix, N_ct: Matrix, scale: float, why: int
) -> Vector:
    """Bound the commanded contact force: compensation, on an obstacle the task, last the rest; then damp the approach.

    Args:
        c: `controller_dtype` record.
        elastic, damping, compensation: torques of the impedance and of (18), (n,), N m; the latter two are changed.
        N_t, N_ct: null-space projectors of the task, and of task and contact, (n, n).
        scale, why: task scale that the tool allows, and its reason.

    Returns:
        Command less c and g, (n,), N m.
    """
    state, params, impedance = c.state, c.params.reaction, c.state.impedance
    qd, direction, M_inv = state.arm.qd, state.isolation.direction, c.dynamics.M_inv
    limit = contact_bound.contact_limit(state.reaction, state.isolation, params)
    reaction.damp_contact(damping, state.mode, N_t, N_ct, qd, impedance.damping_scale, params)
    compensated = contact_bound.bound_compensation(compensation, direction, M_inv, limit)
    left = limit - max(min(compensated, limit), 0.0)
    asked = torque_against_contact(direction, M_inv, elastic)
    if state.mode == COMPLY:
        scale, why = contact_bound.scale_of_task(asked, left, scale, why)
    contact_bound.follow_task_scale(state.reaction, state.mode, scale, why, state.step)
    tau = state.reaction.task_scale * elastic + compensation + damping - state.link_masses.gravity_correction
    c.output.contact_command_nm, c.output.contact_limit_nm = compensated + asked, limit
    contact_bound.remove_excess(tau, direction, M_inv, limit)
    if state.mode == COMPLY:
        # After the bound, or the task would use up what the brake frees.
        rate = c.params.limits.braking_rate - impedance.task_damping
        gone = state.detection.quiet_ticks * c.params.clock.dt > GONE_S
        reaction.damp_approach(
            tau, direction, qd, gone, c.dynamics.M, impedance.joint_damping, rate, params.approach_damping
        )
    return tau


@inlined
def _feel(c: Record) -> None:
    """Find where arm or tool is touched, and report it; no torque of this tick needs it."""
    if c.state.clock.bridged > 0:
        return
    if c.params.reaction.contact_aware != 0:
        follow_touch(c)
    report_touch(c.state, c.output)


@inlined
def _send(c: Record, tau: Vector) -> None:
    """Limit the command, given without c and g; remember it and report."""
    state, dynamics, out = c.state, c.dynamics, c.output
    scaled = state.reaction.task_scale
    limited_by = state.reaction.scale_reason if scaled < 1.0 else 0
    if state.payload.is_load != 0 and scaled < contact_bound.WHOLE:
        limited_by |= LIMITED_BY_LOAD
    met, finite = limit_command(c, tau)
    if not finite:
        latch(state, NO_TORQUE)
    out.limited_by = limited_by | met
    state.command.tau[:] = tau
    fill_tank(state.limits, state.command, dynamics.g, state.arm.qd, state.step.dt, c.params.limits)
    out.torque[:] = tau
    report_arm(c)
    out.target_late = state.clock.target_late
    out.braked = 1 if state.clock.braking != 0 or state.limits.runaway != 0 else 0
