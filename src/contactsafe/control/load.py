"""What the tool carries: taken off the measured wrench where it is known, weighed where it is not.

A body of mass m and centre p, in the tool's frame R, puts g_load = −Jᵥᵀ m γ − J_ωᵀ (R m p × γ) on the joints, γ being
gravity: linear in (m, m p). So one joint's torque at rest is one reading of four numbers.
"""

import math

import numpy as np

from contactsafe.control.estimate import CORRELATED, NOISE_NM, reset_mass_estimate
from contactsafe.control.laws import identify_masses
from contactsafe.control.records import FREE, LOAD
from contactsafe.control.supervisor import enter
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import cross_into, dot, matvec_into, matvec_t_into
from contactsafe.core.stack import stack_vector
from contactsafe.robot.dynamics import update_dynamics

_MASS_SIGMA_KG, _MOMENT_SIGMA_KG_M = 3.0, 0.15
"""What is expected of a load before it is weighed: standard deviations of its mass, and of mass times centre."""

_LARGEST = np.array([100.0, 20.0, 20.0, 20.0])

_FORGET_S = 30.0
"""Time after which what was weighed and shows no more, in another posture, is forgotten."""

_SLOW_RAD_S = 1.0
"""Joints that are faster tell of inertia and friction, not of weight."""

_SETTLE_S = 0.2
"""Until then the observer shows what was before."""

_SMOOTH_S = 0.3
"""Time over which it is judged whether a load explains the torques: each joint is read many times in it."""

_LEFT = 0.25
"""A load explains the torques but for this share of their squares."""

_TOLD = 0.5
"""Mean square of the torques, in units of their error, from which they say anything."""

_REACH_M = 0.4
"""A tool carries nothing whose centre is further from its point."""

_SAGS_M = 0.008
_SAGS_S = 1.0
_LOST = 0.4
"""A tool that misses this much of what it is said to carry does not merely press on something."""

_RISES_M_S = 0.01
"""A tool that a load keeps so far below its target for so long, and that rises no faster, is a fault."""


@compiled
def take_off_payload(c):
    """Take the known payload's weight and inertial force off a measured wrench that has them in it.

    The wrench of the environment is what the sensor shows less (m γ − ṗ, r × m γ − L̇ − v × p), with the payload's
    momentum p and L about the tool point, r from there to its centre, v the tool point's velocity. The rates are
    differences between two measurements, as the observer's is: what one of them errs, the other does.
    """
    state, load = c.state, c.payload
    if load.in_wrench == 0 or state.bridged > 0:
        return
    momentum, weight, turning = stack_vector(6), stack_vector(6), stack_vector(3)
    payload_weight_into(load, c.dynamics.rotation, c.handle.gravity, weight)
    payload_momentum_into(load, c.dynamics, momentum)
    if state.has_wrench != 0:
        cross_into(c.dynamics.velocity[:3], momentum[:3], turning)
        seconds = max(state.since, 1.0) * c.params.dt
        for k in range(6):
            rate = (momentum[k] - state.payload_momentum[k]) / seconds if state.started != 0 else 0.0
            state.wrench_ee[k] += rate - weight[k]
        state.wrench_ee[3:] += turning
    state.payload_momentum[:] = momentum


@compiled
def payload_weight_into(load, rotation, gravity, out):
    """Fill the weight of what the tool carries as a wrench at the tool point, world axes, (6,), N and N m."""
    r = matvec_into(rotation, load.com, stack_vector(3))
    for k in range(3):
        out[k] = load.mass * gravity[k]
    cross_into(r, out[:3], out[3:])
    return out


@compiled
def payload_momentum_into(load, dynamics, out):
    """Fill the momentum of what the tool carries, and that about the tool point, world axes, (6,)."""
    R, v, omega = dynamics.rotation, dynamics.velocity[:3], dynamics.velocity[3:]
    r = matvec_into(R, load.com, stack_vector(3))
    swing = cross_into(omega, r, stack_vector(3))
    for k in range(3):
        out[k] = load.mass * (v[k] + swing[k])
    spin = matvec_into(load.inertia, matvec_t_into(R, omega, stack_vector(3)), stack_vector(3))
    matvec_into(R, spin, out[3:])
    out[3:] += cross_into(r, out[:3], swing)
    return out


@compiled
def reset_payload_estimate(state):
    """Begin to weigh anew what the tool carries beyond what is known."""
    state.load[:] = 0.0
    state.load_covariance[:] = 0.0
    for k in range(4):
        state.load_covariance[k, k] = _prior(k)
    state.load_torque, state.load_left, state.slow_s, state.sags_s, state.loaded = 0.0, 0.0, 0.0, 0.0, 0


@compiled
def _prior(k):
    return _MASS_SIGMA_KG**2 if k == 0 else _MOMENT_SIGMA_KG_M**2


@compiled
def load_regressor_into(c, i, row):
    """Fill the gravity torque at joint i of a load per its mass and mass times centre, (4,), m² / s² and m / s²."""
    J, R, gravity = c.dynamics.J, c.dynamics.rotation, c.handle.gravity
    axis, arm = stack_vector(3), stack_vector(3)
    row[0] = 0.0
    for k in range(3):
        row[0] -= J[k, i] * gravity[k]
        axis[k] = J[3 + k, i]
    cross_into(axis, gravity, arm)  # −J_ω · (R m p × γ) = (J_ω × γ) · R m p
    matvec_t_into(R, arm, row[1:])
    return row


@compiled
def identify_payload(c):
    """Learn what the tool carries beyond the model from one joint's torque, while the arm is slow; one joint a tick.

    The torque is all that acts from outside, also on the tool: the sum of what the sensor shows and the observer finds.
    A fault says where a load keeps the tool from its target.
    """
    state, params = c.state, c.params
    i = state.turn
    state.slow_s = state.slow_s + state.step.dt if _is_slow(state.qd) else 0.0
    if state.slow_s < _SETTLE_S:
        state.loaded, state.sags_s = 0, 0.0
        return
    torque = state.residual[i] + state.unweighed[i]
    if state.has_wrench != 0 and params.cancel_tool_wrench != 0:
        torque += dot(c.dynamics.J[:, i], state.wrench_ee)
    error = NOISE_NM + state.unknown[i] + 0.5 * params.friction[i, 0]  # at rest dry friction takes any part of itself
    forgotten = state.step.dt / _FORGET_S
    for k in range(4):
        state.load[k] *= 1.0 - forgotten
        state.load_covariance[k, k] = min(state.load_covariance[k, k] + forgotten * _prior(k), _prior(k))
    row = load_regressor_into(c, i, stack_vector(4))
    news = -torque - dot(row, state.load)
    share = min(state.step.dt / _SMOOTH_S, 1.0)
    state.load_torque += share * ((torque / error) ** 2 - state.load_torque)
    state.load_left += share * ((news / error) ** 2 - state.load_left)
    identify_masses(state.load, state.load_covariance, row, news, CORRELATED * error * error, _LARGEST)
    state.loaded = 1 if _is_load(state, c.payload.mass) else 0
    _watch_sag(c)


@compiled
def _is_slow(qd):
    for i in range(qd.shape[0]):
        if abs(qd[i]) > _SLOW_RAD_S:
            return False
    return True


@compiled
def _is_load(state, known_kg):
    """Tell whether what acts on the arm is the weight of a body in the tool, or of one that is gone."""
    mass, moment = state.load[0], state.load[1:]
    if state.load_torque < _TOLD or state.load_left > _LEFT * state.load_torque or mass < -1.2 * known_kg:
        return False
    return math.sqrt(dot(moment, moment)) < _REACH_M * abs(mass)


@compiled
def _watch_sag(c):
    """Latch a fault where a load that nobody told of keeps the tool below its target, or draws it further down.

    Or above, where what the tool is said to carry is not there. It takes the place of faults that are over.
    """
    state, error, gravity = c.state, c.output.error, c.handle.gravity
    size = math.sqrt(dot(error[:3], error[:3]))
    side = 1.0 if state.load[0] > 0.0 else -1.0
    down = side * max(math.sqrt(dot(gravity, gravity)), 1e-9)
    against, sinking = -dot(error[:3], gravity) / down, dot(c.dynamics.velocity[:3], gravity) / down
    much = state.load[0] > 0.0 or -state.load[0] > _LOST * c.payload.mass
    sags = state.loaded != 0 and much and size > _SAGS_M and against > 0.5 * size and sinking > -_RISES_M_S
    state.sags_s = state.sags_s + state.step.dt if sags else 0.0
    if state.sags_s > _SAGS_S and state.braking == 0 and state.runaway == 0:
        state.fault = LOAD


@compiled(nogil=True)
def take_up(controllers, index, weight):
    """Go over to another payload, model and all, without a step in what is estimated.

    Args:
        controllers: array of records whose handle and payload are the new ones already.
        index: which of them.
        weight: of what was carried before, as a wrench at the tool point, (6,), N and N m.
    """
    c = controllers[index]
    state, dynamics, n = c.state, c.dynamics, c.state.tau.shape[0]
    change, new_weight = stack_vector(n), stack_vector(6)
    change[:] = dynamics.g
    update_dynamics(c.handle, state.q_good, state.qd_good, dynamics)
    for i in range(n):
        change[i] = dynamics.g[i] - change[i]
        state.beta[i] = dynamics.g[i] - dynamics.CT_qd[i]
        state.impulse[i] -= state.impulse_ticks * change[i]
    matvec_into(dynamics.M, state.qd_good, state.momentum)
    payload_momentum_into(c.payload, dynamics, state.payload_momentum)
    share = _there(state.residual, change)
    _move(state.residual, share, change)
    _move(state.observed, share, change)
    detection_filter_gain = _there(state.residual_fast, change)
    _move(state.residual_fast, detection_filter_gain, change)
    _move(state.observed_fast, detection_filter_gain, change)
    payload_weight_into(c.payload, dynamics.rotation, c.handle.gravity, new_weight)
    for k in range(6):
        state.tool_wrench[k] -= share * (new_weight[k] - weight[k])
    if state.has_wrench == 0:
        for k in range(3):
            state.tool_force[k] -= share * (new_weight[k] - weight[k])
    if detection_filter_gain > 0.5:  # what was a contact was the load; what else there is shows at once
        enter(state, FREE)
    reset_mass_estimate(c)
    reset_payload_estimate(state)
    if state.fault == LOAD:
        state.fault = 0


@compiled
def _move(vector, share, change):
    for i in range(vector.shape[0]):
        vector[i] += share * change[i]


@compiled
def _there(residual, change):
    """Share of a change of the gravity torque that the residual shows already, 0 … 1: it has been carried all along."""
    size = dot(change, change)
    return min(max(-dot(residual, change) / size, 0.0), 1.0) if size > 0.0 else 0.0
