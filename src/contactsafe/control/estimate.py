"""What acts on the arm, from joint measurements: the momentum observer, the weighing of the links, what is the tool's.

Each function advances one part of a controller record by one tick.
"""

import math

import numpy as np

from contactsafe.control.clock import BRIDGE_TICKS
from contactsafe.control.laws import identify_masses, line_of_action_misses_tool, momentum_into, observer_step
from contactsafe.control.records import FREE
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, matvec_into, matvec_t_into
from contactsafe.core.stack import stack_vector
from contactsafe.robot.dynamics import mass_regressor
from contactsafe.robot.friction import joint_friction_into

_SIGMAS = 3.0
"""A contact is what exceeds this many standard deviations of the weight that is not known yet."""

CORRELATED = 10.0
"""Readings of one joint's residual, a few ms apart, err alike: so many of them count as one."""

NOISE_NM = 0.15
"""Standard deviation of a residual beside what friction, inertia and delay come to."""

FORGET_S = 8.0
"""Time after which what was weighed is as uncertain as before."""

_SETTLE_TICKS = 40

_GAP = 0.3
"""Share of the time between two measurements in which the tool's wrench was not measured that counts as a gap."""


@compiled
def start(c):
    """Begin where the arm is: momentum as measured, command as last sent; the links weigh what is said."""
    state, dynamics, params = c.state, c.dynamics, c.params
    state.started = 1
    state.task_scale, state.posture_scale = 1.0, 1.0
    state.tank_j = params.tank_j
    state.K_task[:] = state.target.K_task
    state.D_task[:] = state.target.D_task
    reset_mass_estimate(c)
    for i in range(state.gravity_sigma.shape[0]):
        state.gravity_sigma[i] = _gravity_sigma(c, i)
    momentum_into(dynamics.M, state.qd, state.momentum)
    for i in range(state.beta.shape[0]):
        state.beta[i] = dynamics.g[i] - dynamics.CT_qd[i]
        # What the torque last sent did is not known: all of it that the arm did not need is put down to friction this
        # once, so that the first raw external torque is zero.
        state.friction[i] = state.tau[i] - state.beta[i]
        state.tau_before[i] = state.tau[i]


@compiled
def reset_mass_estimate(c):
    """Begin to weigh the links anew."""
    state = c.state
    state.mass_error[:] = 0.0
    state.mass_covariance[:] = 0.0
    for j in range(state.mass_error.shape[0]):
        state.mass_covariance[j, j] = c.params.mass_variance[j]


@compiled
def correct_gravity(c):
    """Add what the links were found to weigh more than the model says to the model's gravity torque.

    That is for the observer and the bounds. The command does without, see `unweighed`: in free motion the arm moves as
    it would without all this, and nothing that was learned wrongly from a light touch pulls it.
    """
    state = c.state
    if not c.params.mass_variance.any():
        return
    mass_regressor(c.handle, c.dynamics.mass_regressor)
    if c.state.has_wrench != 0:
        c.dynamics.mass_regressor[:, -1] = 0.0  # the tool's own weight shows in the wrench and cancels
    heavier = matvec_into(c.dynamics.mass_regressor, state.mass_error, stack_vector(state.unweighed.shape[0]))
    for i in range(heavier.shape[0]):
        state.unweighed[i] = -heavier[i]
        c.dynamics.g[i] += heavier[i]


@compiled
def observe(c):
    """Raw external torque since the last good measurement, two observers of it, a low-pass behind each; (10)-(14).

    It is a mean over the time that passed, in which what was commanded is known tick by tick.
    """
    state, dynamics, params, step = c.state, c.dynamics, c.params, c.state.step
    n = state.tau.shape[0]
    state.impulse_ticks += state.elapsed
    for i in range(n):
        beta = dynamics.g[i] - dynamics.CT_qd[i]
        applied = state.tau[i] - state.friction[i] - 0.5 * (beta + state.beta[i])
        state.impulse[i] += state.elapsed * applied
        state.beta[i] = beta
    if state.bridged > 0:
        return
    p = momentum_into(dynamics.M, state.qd, stack_vector(n))
    tau_external, rate, ramp, tau_tool = stack_vector(n), stack_vector(n), stack_vector(n), stack_vector(n)
    for i in range(n):
        ramp[i] = (state.tau[i] - state.tau_before[i]) / state.since
        rate[i] = (p[i] - state.momentum[i]) / (state.since * params.dt)
        tau_external[i] = rate[i] - state.impulse[i] / state.impulse_ticks
        state.tau_before[i], state.momentum[i], state.impulse[i] = state.tau[i], p[i], 0.0
    state.impulse_ticks = 0.0
    _tool_torque(c, tau_tool)
    if state.since > BRIDGE_TICKS + 1.5 or state.unclear != 0:
        return
    for i in range(n):
        tau_external[i] -= tau_tool[i]
    observer_step(state.observed, step.compensation_filter_gain, tau_external)
    observer_step(state.observed_fast, step.detection_filter_gain, tau_external)
    observer_step(state.observed_rate, step.detection_filter_gain, rate)
    observer_step(state.observed_ramp, step.detection_filter_gain, ramp)
    observer_step(state.residual, step.lowpass_gain, state.observed)
    observer_step(state.residual_fast, step.lowpass_gain, state.observed_fast)
    observer_step(state.momentum_rate, step.lowpass_gain, state.observed_rate)
    observer_step(state.torque_ramp, step.lowpass_gain, state.observed_ramp)


@compiled
def _tool_torque(c, out):
    """Fill the measured tool wrench as joint torque, (n,), N m: of the last tick, and of those before it by its mean.

    What the tool felt in a gap nobody knows; it may be all that it felt of late. That is `unseen`, and dies out as it
    does in the observers.
    """
    state, J, step = c.state, c.dynamics.J, c.state.step
    out[:] = 0.0
    if state.has_wrench == 0 or c.params.cancel_tool_wrench == 0:
        return
    matvec_t_into(J, state.wrench_ee, out)
    fade = 1.0 - 0.4 * min(step.detection_filter_gain, step.lowpass_gain)
    for i in range(out.shape[0]):
        state.felt[i] = max(abs(out[i]), (1.0 - step.tool_share) * state.felt[i])
        state.unseen[i] *= fade
    gap = 1.0 - 1.0 / state.since
    if gap > _GAP:
        before = matvec_t_into(J, state.wrench_before, stack_vector(out.shape[0]))
        for i in range(out.shape[0]):
            state.unseen[i] = max(state.unseen[i], 1.2 * gap * state.felt[i])
            out[i] += 0.5 * gap * (before[i] - out[i])
    state.wrench_before[:] = state.wrench_ee


@compiled
def separate_tool_wrench(c, J_bar):
    """Split the residual into the tool's share and the arm's; fill `arm_torque`, `arm_torque_fast` and `alarm`.

    With a force sensor the tool's wrench is known and taken out already. Without one, a wrench at the tool never shows
    in the null space, N_tᵀ Jᵀ F = 0: what does is the arm's contact. So is a force whose line passes far from the tool;
    of the rest, the wrench that was there before the contact stays the tool's. An arm without a null space cannot tell:
    there all of it counts as the arm's.
    """
    state, J = c.state, c.dynamics.J
    n = state.tau.shape[0]
    state.alarm[:] = state.residual_fast
    if c.state.has_wrench != 0 or c.params.cancel_tool_wrench == 0 or n <= 6:
        state.arm_torque[:] = state.residual
        state.arm_torque_fast[:] = state.residual_fast
        return
    tau_tool = stack_vector(n)
    wrench = matvec_t_into(J_bar, state.residual_fast, stack_vector(6))
    if not line_of_action_misses_tool(wrench, c.params.tool_radius_m, c.params.tool_moment_nm):
        state.alarm -= matvec_t_into(J, wrench, tau_tool)
    if state.mode == FREE:
        observer_step(state.tool_wrench, state.step.tool_share, wrench)
    matvec_t_into(J, state.tool_wrench, tau_tool)
    for i in range(n):
        state.arm_torque[i] = state.residual[i] - tau_tool[i]
        state.arm_torque_fast[i] = state.residual_fast[i] - tau_tool[i]


@compiled
def set_thresholds(c):
    """Give each joint the threshold that what is not known of the arm asks for.

    δ plus a share of friction and of inertial torque, whose model is not exact, plus what a late command is short of,
    what the tool may have felt unseen, and the standard deviation of the gravity torque that is left after weighing.
    """
    state, params = c.state, c.params
    friction = joint_friction_into(params.friction, c.state.qd, stack_vector(state.threshold.shape[0]))
    for i in range(state.threshold.shape[0]):
        inertial = abs(state.momentum_rate[i]) + abs(c.dynamics.CT_qd[i])
        unknown = params.friction_uncertainty * abs(friction[i]) + params.inertia_uncertainty * inertial
        unknown += params.delay_uncertainty_ticks * abs(state.torque_ramp[i]) + state.unseen[i]
        state.unknown[i] = unknown
        state.threshold[i] = params.residual_threshold + unknown + _SIGMAS * state.gravity_sigma[i]


@compiled
def identify_link_masses(c):
    """Learn how far the links' masses are from the model's, from one joint's residual a tick, without contact.

    Without a force sensor nothing is learned, and with one the tool's weight does not show: what is not known of them
    stays what it was at first.
    """
    state, params, dynamics = c.state, c.params, c.dynamics
    if not params.mass_variance.any():
        return
    i = state.turn
    row = dynamics.mass_regressor[i]
    for j in range(row.shape[0]):
        forgotten = state.mass_covariance[j, j] + params.mass_variance[j] * state.step.dt / FORGET_S
        state.mass_covariance[j, j] = min(forgotten, params.mass_variance[j])
    told = c.state.has_wrench != 0
    state.ticks += 1
    if told and state.mode == FREE and state.quiet_ticks > 0 and state.ticks > _SETTLE_TICKS:
        error = NOISE_NM + state.unknown[i]
        largest = _SIGMAS * np.sqrt(params.mass_variance)
        identify_masses(
            state.mass_error, state.mass_covariance, row, -state.residual[i], CORRELATED * error * error, largest
        )
    state.gravity_sigma[i] = _gravity_sigma(c, i)


@compiled
def _gravity_sigma(c, i):
    """Standard deviation of what joint i's gravity torque differs from the model's, N m."""
    row = c.dynamics.mass_regressor[i]
    P_row = matvec_into(c.state.mass_covariance, row, stack_vector(row.shape[0]))
    return math.sqrt(max(dot(row, P_row), 0.0))
