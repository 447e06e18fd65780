"""Limits: what keeps a command within bounds, whatever is asked: power, joint range and speed, torque and its rate."""

import math

import numpy as np

from contactsafe.control.braking import brake_into, braking_fraction
from contactsafe.control.codes import LIMITED_BY_ENERGY, LIMITED_BY_RANGE, LIMITED_BY_RATE
from contactsafe.control.joint_stops import (
    joint_excess,
    joint_stop_gains,
    joint_stop_torque,
    predict_velocity,
    stops_dtype,
)
from contactsafe.control.plausibility import all_usable
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot, matvec_into
from contactsafe.core.stack import stack_vector
from contactsafe.robot.friction import joint_drag_into

_f = np.float64
_i = np.int64

_STILL = 1e-12
"""Twice the energy of an arm that stands still, J: no torque gives it any power worth the name."""

_ASTRAY_RAD_S2 = 50.0
"""By how much a joint may accelerate otherwise than asked where others are clipped, rad/s²: no heavy one does."""

_SWEEPS = 6
"""Over all joints, in search of the least constraint; on arms of all kinds more change nothing that matters."""


def limits_dtype(n: int) -> np.dtype:
    """Describe what the limits remember."""
    return np.dtype(
        [
            ("tank_j", _f),  # energy that the command may still give, J
            ("runaway", _i),  # 1 once a joint stayed beyond its speed limit though it was braked, until reset
            ("overspeed_s", _f, (n,)),  # time beyond the speed limit, s
            ("stops", stops_dtype(n)),
        ]
    )


@inlined
def limit_command(c: Record, tau: Vector) -> tuple[int, bool]:
    """Keep a command within all limits, in place; return what took something off it, a sum of keys of LIMITS.

    Joint stops are reckoned from what the motors can do, not from what is asked of them: so torque is limited first,
    and at the end once more, with its rate. The torque limits count c and g, the joint stops neither, the energy tank c
    alone: here, and nowhere else, they are added and taken off.

    Args:
        c: `controller_dtype` record; its `limits` and `command` are advanced.
        tau: command less c and g, (n,), N m; updated: what is sent, with them and friction compensation.

    Returns:
        Limits met; and whether all numbers of the command were finite.
    """
    state, dynamics, params = c.state, c.dynamics, c.params
    command, step = state.command, state.step
    tau += dynamics.c
    tau += dynamics.g
    finite = replace_unusable(tau, command.tau)
    clipped = limit_torque(tau, command.tau, params.arm.tau_max, math.inf, dynamics.M_inv)
    tau -= dynamics.g + dynamics.c
    limited_by = 0
    dt = max(step.dt, params.clock.dt)
    torque_step = params.one_tick.torque_step
    predict_velocity(state.limits.stops, state.arm.qd, dynamics.M_inv, state.observer.momentum_rate, torque_step, dt)
    if _stop_joints(state.limits.stops, state.arm, state.impedance, dynamics, params, tau):
        limited_by |= LIMITED_BY_RANGE
    tau += dynamics.c
    energy = params.limits
    if power_limit(tau, dynamics.M, state.arm.qd, state.limits.tank_j, energy.tank_power_w, energy.tank_s):
        limited_by |= LIMITED_BY_ENERGY
    if _slow_down(state.limits, state.arm.qd, dynamics, params, tau):
        limited_by |= LIMITED_BY_RANGE
    tau += dynamics.g
    command.friction[:] = 0.0
    if params.impedance.friction_compensation != 0:
        tau += joint_drag_into(params.arm.friction, params.arm.drag, state.arm.qd, command.friction)
    finite = replace_unusable(tau, command.tau) and finite
    clipped = limit_torque(tau, command.tau, params.arm.tau_max, step.torque_step, dynamics.M_inv) or clipped
    return limited_by | LIMITED_BY_RATE if clipped else limited_by, finite


@inlined
def replace_unusable(tau: Vector, tau_previous: Vector) -> bool:
    """Repeat the last command in place where a law gave none that is finite; tell whether it was finite."""
    if all_usable(tau):
        return True
    tau[:] = tau_previous
    return False


@inlined
def fill_tank(limits: Record, command: Record, g: Vector, qd: Vector, dt: float, params: Record) -> None:
    """Take what the command gives the arm out of the tank, and add the steady power."""
    given = dot(command.tau - command.friction - g, qd)
    limits.tank_j = min(limits.tank_j + dt * (params.tank_power_w - given), params.tank_j)


@inlined
def runs_away(limits: Record, qd: Vector, M: Matrix, dt: float, arm: Record) -> bool:
    """Tell whether a joint stays beyond its speed limit for longer than braking it takes.

    Args:
        limits: `limits_dtype` record; its times are advanced.
        qd: (n,), rad/s.
        M: joint inertia, (n, n), kg m².
        dt: that passed, s.
        arm: `arm_dtype` record.
    """
    some = False
    for i in range(qd.shape[0]):
        excess = abs(qd[i]) - arm.runaway_speed[i]
        if excess <= 0.0:
            limits.overspeed_s[i] = 0.0
            continue
        limits.overspeed_s[i] += dt
        some = some or limits.overspeed_s[i] > arm.reversal_s[i] + excess * M[i, i] / arm.tau_max[i]
    return some


@inlined
def _stop_joints(
    stops: Record, arm: Record, impedance: Record, dynamics: Record, params: Record, tau_net: Vector
) -> bool:
    """Keep joints in their range and below their speed limits, in place; tell whether that took anything."""
    known = params.limits
    if not joint_excess(stops, arm.q, arm.qd, params.arm, known.joint_margin, known.joint_deceleration):
        return False
    rate = known.braking_rate - impedance.task_damping
    joint_stop_gains(
        stops, dynamics.M, impedance.joint_damping, rate, known.joint_brake, known.joint_stop_stiffness,
        params.clock.loop_delay_s,
    )  # fmt: skip
    joint_stop_torque(stops, tau_net, dynamics.M_inv, arm.qd, known.joint_margin)
    return True


@inlined
def _slow_down(limits: Record, qd: Vector, dynamics: Record, params: Record, tau: Vector) -> bool:
    """Brake the whole arm in place of the command as far as it is too fast; tell whether that took anything.

    Where it has run away nothing but that is left to do.
    """
    arm, fraction = params.arm, 1.0
    if limits.runaway == 0:
        fraction = braking_fraction(qd, limits.stops.speed, dynamics.c, arm.runaway_speed, arm.tau_max)
    if fraction == 0.0:
        return False
    brake, torque_rate = stack_vector(tau.shape[0]), params.one_tick.torque_step / params.clock.dt
    brake_into(dynamics.M, dynamics.M_inv, qd, arm.tau_max, torque_rate, params.limits.damping_rate, brake)
    for i in range(tau.shape[0]):
        tau[i] += fraction * (brake[i] + dynamics.c[i] - tau[i])
    return True


@compiled
def power_limit(tau: Vector, M: Matrix, qd: Vector, tank: float, power: float, drain_s: float) -> bool:
    """Damp a command in place to give the arm no more power than a tank of energy can pay; tell whether it had to.

    The tank is filled with a steady power and by what the command takes out of the arm. Its level falls no faster than
    level/drain_s beyond that power; what is taken off brakes all joints alike, along M q̇: it turns no light joint back.

    Args:
        tau: command less gravity torque, (n,), N m; updated.
        M: joint inertia, (n, n), kg m².
        qd: (n,), rad/s.
        tank: level, J.
        power: steady, W.
        drain_s: s.
    """
    allowed = power + max(tank, 0.0) / drain_s
    given = dot(tau, qd)
    if given <= allowed:
        return False
    momentum = matvec_into(M, qd, stack_vector(qd.shape[0]))
    energy = dot(momentum, qd)
    if energy <= _STILL:
        return False
    for i in range(qd.shape[0]):
        tau[i] -= (given - allowed) / energy * momentum[i]
    return True


@compiled
def limit_torque(tau: Vector, tau_previous: Vector, tau_max: Vector, step_max: float, M_inv: Matrix) -> bool:
    """Keep a command within the torque limits and a largest change per tick, in place, and as near to what was asked.

    A joint whose torque is clipped accelerates otherwise than it was asked to, and drags along all that is coupled to
    it: 30 N m too little on a shoulder fling a wrist of 1e-5 kg m² aside. By Gauss's principle of least constraint the
    command sought has the least (τ − τ_w)ᵀ M⁻¹ (τ − τ_w): every joint that is not at a bound then accelerates just as
    asked.

    Args:
        tau: command τ_w, (n,), N m; updated.
        tau_previous: last command sent, (n,), N m.
        tau_max: (n,), N m.
        step_max: N m per tick.
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).

    Returns:
        True where anything was clipped.
    """
    clipped = False
    for i in range(tau.shape[0]):
        low, high = _bounds(tau_previous[i], tau_max[i], step_max)
        clipped = clipped or tau[i] < low or tau[i] > high
    if clipped:
        _constrain_least(tau, tau_previous, tau_max, step_max, M_inv)
    return clipped


@compiled
def _bounds(tau_previous: float, tau_max: float, step_max: float) -> tuple[float, float]:
    """Return what a torque may be: within the limit, even where the last one was beyond it."""
    low = min(max(tau_previous - step_max, -tau_max), tau_max)
    return low, max(min(tau_previous + step_max, tau_max), -tau_max)


@compiled
def _constrain_least(tau: Vector, tau_previous: Vector, tau_max: Vector, step_max: float, M_inv: Matrix) -> None:
    """Clip a command in place, and let each joint in turn make up for it; no such step makes it worse."""
    n = tau.shape[0]
    low, high, change = stack_vector(n), stack_vector(n), stack_vector(n)
    for i in range(n):
        low[i], high[i] = _bounds(tau_previous[i], tau_max[i], step_max)
        value = min(max(tau[i], low[i]), high[i])
        change[i], tau[i] = value - tau[i], value
    for sweep in range(_SWEEPS):
        moved = False
        for k in range(n):
            i = k if sweep % 2 == 0 else n - 1 - k
            astray = dot(M_inv[i], change)  # acceleration beyond what was asked, rad/s²
            much = max(astray - _ASTRAY_RAD_S2, 0.0) + min(astray + _ASTRAY_RAD_S2, 0.0)
            value = min(max(tau[i] - much / M_inv[i, i], low[i]), high[i])
            moved = moved or value != tau[i]
            change[i] += value - tau[i]
            tau[i] = value
        if not moved:
            break
