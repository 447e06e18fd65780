"""What is known of the arm and of what touches it, from measurements alone: all that comes before the laws.

measurement → observer → detection → isolation → identification → classification
"""

import math

import numpy as np

from contactsafe.control.base_wrench import observe_base
from contactsafe.control.classification import contact_kind
from contactsafe.control.clock import narrow_band, receive, set_step
from contactsafe.control.codes import BAD_MEASUREMENT, FREE, LOAD, RUNAWAY, TOOL
from contactsafe.control.contact_work import is_active
from contactsafe.control.detection import set_thresholds
from contactsafe.control.laws import line_of_action_misses_tool, task_inertia
from contactsafe.control.limits import runs_away
from contactsafe.control.link_masses import correct_gravity, identify_link_masses, start_link_masses
from contactsafe.control.noise import follow_noise
from contactsafe.control.observer import observe, start_observer
from contactsafe.control.payload import (
    identify_payload,
    is_settled,
    load_regressor_into,
    load_sags,
    reset_payload,
    take_off_payload,
)
from contactsafe.control.plausibility import BRIDGE_TICKS, is_usable
from contactsafe.control.supervision import supervise
from contactsafe.control.tool_force import follow_tool_force
from contactsafe.control.tool_wrench import separate_tool_wrench, take_all_for_the_arm
from contactsafe.control.touch import follow_change, follow_touch
from contactsafe.control.velocity import follow_velocities
from contactsafe.core.arrays import Matrix, Record
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot, matmul, matvec_t_into
from contactsafe.core.stack import stack_vector
from contactsafe.robot.dynamics import update_dynamics

_SIGMAS = 2.0
"""Standard deviations of the residual that the moment at the tool may be wrong by."""


@compiled
def follow_arm(c: Record, usable: bool) -> None:
    """Take a measurement over, or bridge it, and bring the nominal dynamics to where the arm is believed to be.

    Args:
        c: `controller_dtype` record.
        usable: whether the measurement `is_usable`.
    """
    state, dynamics = c.state, c.dynamics
    receive(c, usable)
    update_dynamics(c.handle, state.arm.q, state.arm.qd, dynamics)
    if c.payload.in_wrench != 0 and state.clock.bridged == 0:
        seconds = max(state.clock.since, 1.0) * c.params.clock.dt
        take_off_payload(state.payload, state.arm, c.payload, dynamics, c.handle.gravity, seconds, state.started)
    mass_variance = c.params.identification.mass_variance
    correct_gravity(state.link_masses, dynamics, c.handle, state.arm.has_wrench, mass_variance)


@compiled
def start_estimation(c: Record) -> None:
    """Begin where the arm is: momentum as measured, masses as the model says."""
    state = c.state
    state.started = 1
    start_link_masses(state.link_masses, c.dynamics.mass_regressor, c.params.identification.mass_variance)
    start_observer(state.observer, state.command, c.dynamics, state.arm, c.params)
    reset_payload(state.payload)


@compiled
def latch(state: Record, fault: int) -> None:
    """Keep the first fault since reset, 0 is none; what brakes the arm and LOAD are written over it."""
    if state.fault == 0:
        state.fault = fault


@inlined
def _set_time(state: Record, params: Record, untouched: bool) -> None:
    """Take the velocity in force, and set the step to the time between it and the one before."""
    observer, ticks = state.observer, state.clock.since
    if state.clock.bridged == 0:
        ticks = follow_velocities(
            observer.velocity, state.arm, ticks, params.clock.dt, untouched, params.observer.velocity_source
        )
    set_step(state.step, params.one_tick, min(ticks, BRIDGE_TICKS + 1.0))
    narrow_band(state.step, observer.noise.bandwidth)


@inlined
def estimate(c: Record, J_bar: Matrix) -> None:
    """Estimate what touches the arm, from residual to mode, and masses, over the time since the last measurement."""
    state, params, dynamics, observer = c.state, c.params, c.dynamics, c.state.observer
    detection, masses, tool = state.detection, state.link_masses, state.tool_wrench
    untouched = state.mode == FREE and state.touch.withholds == 0 and detection.quiet_ticks > 0
    _set_time(state, params, untouched)
    went_on = observe(observer, state.arm, state.clock, state.step, state.command, dynamics, params)
    if state.clock.bridged > 0:
        return
    observe_base(state.base, c.handle, state, dynamics, params)
    set_thresholds(detection, observer, masses.gravity_sigma, state.arm, dynamics.CT_qd, params)
    if went_on:
        follow_noise(
            observer.noise, observer.raw, detection.model_uncertainty, observer.velocity.of_positions, state.step,
            untouched, _is_tool_free(state, params), params.observer.residual_noise_nm,
        )  # fmt: skip
    if state.arm.has_wrench != 0 or params.observer.cancel_tool_wrench == 0 or state.arm.q.shape[0] <= 6:
        take_all_for_the_arm(tool, detection.residual, observer)
    else:
        beside_tool = is_active(state.contact_work) and _is_beside_tool(state, J_bar, params.identification)
        separate_tool_wrench(
            tool, detection.residual, observer, dynamics.J, J_bar, state.mode, beside_tool, state.step,
            params.identification,
        )  # fmt: skip
    follow_change(c)
    supervise(c)
    _identify(c)
    if _has_unknown_load(c) and state.clock.braking == 0 and state.limits.runaway == 0:
        state.fault = LOAD  # it takes the place of faults that are over
    state.turn = (state.turn + 1) % state.arm.q.shape[0]
    if runs_away(state.limits, state.arm.qd, dynamics.M, state.step.dt, params.arm):
        state.fault, state.limits.runaway = RUNAWAY, 1
    state.clock.since = 0.0


@inlined
def _is_beside_tool(state: Record, J_bar: Matrix, params: Record) -> bool:
    """Tell whether the line of what has changed since nothing touched passes the tool by, with the least margin."""
    touch, sigma = state.touch, 0.0
    change = matvec_t_into(J_bar, touch.torque, stack_vector(6))
    for i in range(touch.sigma.shape[0]):
        sigma += touch.sigma[i] * touch.sigma[i]
    margin = min(_SIGMAS * math.sqrt(sigma), params.tool_moment_nm)
    return line_of_action_misses_tool(change, params.tool_radius_m, margin)


@inlined
def _is_tool_free(state: Record, params: Record) -> bool:
    """Tell whether no contact of the tool is in the raw torque: a sensor takes it out, or it presses with little."""
    if state.arm.has_wrench != 0 and params.observer.cancel_tool_wrench != 0:
        return True
    force, least = state.tool_wrench.force, params.classification.tool_contact_n
    return dot(force, force) < least * least


@inlined
def _identify(c: Record) -> None:
    """Identify link masses from one joint's residual, while nothing touches the arm."""
    state, params, observer, dynamics = c.state, c.params, c.state.observer, c.dynamics
    i, untouched = state.turn, state.mode == FREE and state.touch.withholds == 0 and state.detection.quiet_ticks > 0
    identify_link_masses(
        state.link_masses, i, observer.residual[i], state.detection.model_uncertainty[i], dynamics.mass_regressor[i],
        state.step.dt, untouched and state.arm.has_wrench != 0, params.identification.mass_variance,
    )  # fmt: skip


@inlined
def _has_unknown_load(c: Record) -> bool:
    """Identify the payload from one joint's torque, all that acts from outside; tell whether it keeps the tool away."""
    state, dynamics, gravity, dt, i = c.state, c.dynamics, c.handle.gravity, c.state.step.dt, c.state.turn
    payload, known_kg = state.payload, c.payload.mass
    if not is_settled(payload, state.arm.qd, dt):
        return False
    torque = state.observer.residual[i] - state.link_masses.gravity_correction[i]
    if state.arm.has_wrench != 0 and c.params.observer.cancel_tool_wrench != 0:
        torque += dot(dynamics.J[:, i], state.arm.wrench_ee)
    row = load_regressor_into(dynamics, gravity, i, stack_vector(4))
    uncertainty = state.detection.model_uncertainty[i]
    known = c.params.arm
    dry = known.friction[i, 0] + max(known.drag[i, 2], known.friction_unknown[i, 1])
    dry_friction = 0.0 if state.arm.has_torque != 0 else dry
    identify_payload(payload, row, torque, uncertainty, dry_friction, dt, known_kg)
    error, velocity = stack_vector(3), stack_vector(3)
    for k in range(3):
        error[k] = c.output.error[k] if state.target.K_task[k] > 0.0 else 0.0
        velocity[k] = dynamics.velocity[k] + dynamics.carried_velocity[k]
    return load_sags(payload, error, velocity, gravity, known_kg, dt)


@compiled
def report_arm(c: Record) -> None:
    """Report what is known of the arm and of what touches it."""
    state, dynamics, out = c.state, c.dynamics, c.output
    out.residual[:] = state.observer.residual
    out.residual_fast[:] = state.observer.residual_fast
    out.position[:] = dynamics.position
    out.rotation[:] = dynamics.rotation
    out.velocity[:] = dynamics.velocity
    out.velocity += dynamics.carried_velocity
    out.mode, out.fault = state.mode, state.fault
    out.kind = contact_kind(state.mode, state.tool_wrench.force, c.params.classification.tool_contact_n)


@compiled(nogil=True)
def estimate_at(controllers: np.ndarray, i: int) -> None:
    """Run all that comes before the laws on one of an array of records; what was commanded is the caller's to say."""
    c = controllers[i]
    usable = is_usable(c.measurement, c.params.arm, 0)
    if not usable:
        latch(c.state, BAD_MEASUREMENT)
        if c.state.started == 0:
            return
    follow_arm(c, usable)
    if c.state.started == 0:
        start_estimation(c)
    known, dynamics = c.params.impedance, c.dynamics
    Lambda, J_M_inv = task_inertia(dynamics.J, dynamics.M_inv, known.manipulability_floor, known.manipulability_damping)
    J_bar = matmul(J_M_inv.T, Lambda)
    estimate(c, J_bar)
    report_arm(c)
    if c.state.clock.bridged == 0:
        _feel_alone(c.state, c, J_bar)


@inlined
def _feel_alone(state: Record, c: Record, J_bar: Matrix) -> None:
    """Report what touches arm or tool where no law goes by it."""
    follow_tool_force(
        state.tool_wrench, state.arm, state.mode, state.observer.residual_fast, J_bar, c.params.arm,
        state.step.probe_gain,
    )  # fmt: skip
    follow_touch(c)
    state.touch.withholds = state.touch.touching
    c.output.kind = state.touch.kind
    report_touch(state, c.output)
    if c.output.touched != 0:
        c.output.link = c.output.touched


@inlined
def report_touch(state: Record, out: Record) -> None:
    """Report where arm or tool is touched, with what force, and how probable it is the one that was reported.

    Args:
        out: `output_dtype` record, its kind set.
    """
    touch, place = state.touch, state.localisation
    out.probability, out.several, out.touched = 1.0, 0, 0
    out.point[:], out.force[:] = 0.0, 0.0
    if touch.touching == 0 or place.best < 0:
        return
    out.probability = place.tool_probability if out.kind == TOOL else 1.0 - place.tool_probability
    out.several = 1 if place.left_over > 1.0 else 0
    out.touched = min(place.link, state.arm.q.shape[0])
    out.point[:], out.force[:] = place.point, place.force
