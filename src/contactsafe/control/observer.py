"""Observer: residuals, what acts on the arm from outside as torque at its joints, from momentum alone; (10)-(14).

What drives the arm is its command less friction, and its momentum has the rotors' in it. Where the torque behind the
gears is measured, that drives the links alone: friction and rotors lie before the sensor and are out of the model.
"""

import numpy as np

from contactsafe.control.laws import momentum_into, observer_step
from contactsafe.control.noise import noise_dtype, start_noise
from contactsafe.control.plausibility import BRIDGE_TICKS
from contactsafe.control.velocity import is_of_middle, start_velocity, velocity_dtype
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import matvec_t_into
from contactsafe.core.stack import stack_vector

_f = np.float64
_i = np.int64

_UNKNOWN = -1
"""Neither with the rotors nor without: no momentum is compared with the next."""

_GAP = 0.3
"""Fraction of the time between two measurements in which the tool's wrench was not measured that counts as a gap."""


def observer_dtype(n: int) -> np.dtype:
    """Describe what the observer remembers."""
    return np.dtype(
        [
            ("raw", _f, (n,)),  # external torque since the measurement before, N m
            ("residual", _f, (n,)),  # that the law compensates, N m
            ("residual_fast", _f, (n,)),  # that detects, N m
            ("residual_unfiltered", _f, (n,)),  # before their low-pass, N m
            ("residual_fast_unfiltered", _f, (n,)),
            ("momentum_rate", _f, (n,)),  # behind the filters of the fast residual, N m
            ("momentum_rate_unfiltered", _f, (n,)),
            ("torque_ramp", _f, (n,)),  # change of the command per tick behind the same filters, N m
            ("torque_ramp_unfiltered", _f, (n,)),
            ("velocity", velocity_dtype(n)),
            ("noise", noise_dtype(n)),
            ("momentum", _f, (n,)),  # at the last good measurement, kg m²/s
            ("beta", _f, (n,)),  # g − Cᵀ q̇ at the last tick, N m
            ("impulse", _f, (n,)),  # of the command less friction and β since the last good measurement, N m ticks
            ("impulse_ticks", _f),  # in so many ticks
            ("impulse_before", _f, (n,)),  # the same between the two measurements before, N m ticks
            ("tau_before", _f, (n,)),  # command at the last good measurement, N m
            ("torque_before", _f, (n,)),  # measured at the joints then, N m
            ("behind_gears", _i),  # whether it was, −1 at first
            ("wrench_before", _f, (6,)),  # on the tool then, N and N m
            ("tool_torque_recent", _f, (n,)),  # largest torque of the tool's wrench of late, N m
            ("tool_torque_unseen", _f, (n,)),  # that a gap in the measurements may have hidden, N m
        ]
    )


@compiled
def start_observer(observer: Record, command: Record, dynamics: Record, arm: Record, params: Record) -> None:
    """Begin with the momentum of now, and a raw external torque of zero.

    What the torque last sent did is not known: all of it that the arm did not need is put down to friction this once.
    """
    start_velocity(observer.velocity, arm.q, arm.qd)
    start_noise(observer.noise, params.observer.residual_noise_nm)
    _momentum_into(observer, dynamics.M, arm, params.arm.rotor, observer.momentum)
    if arm.has_torque != 0:
        observer.behind_gears = _UNKNOWN  # what it drives first shows with the next measurement
    for i in range(arm.q.shape[0]):
        observer.beta[i] = dynamics.g[i] - dynamics.CT_qd[i]
        command.friction[i] = command.tau[i] - observer.beta[i]
        observer.tau_before[i] = command.tau[i]


@compiled
def _momentum_into(observer: Record, M: Matrix, arm: Record, rotor: Vector, out: Vector) -> Vector:
    """Fill the momentum of the links, and of the rotors where no torque is measured behind them, (n,), kg m²/s."""
    qd = observer.velocity.qd
    momentum_into(M, qd, out)
    observer.behind_gears = arm.has_torque
    if arm.has_torque != 0:
        observer.torque_before[:] = arm.torque
        for i in range(rotor.shape[0]):
            out[i] -= rotor[i] * qd[i]
    return out


@compiled
def rebase_momentum(observer: Record, M: Matrix, arm: Record, rotor: Vector, qd: Vector) -> None:
    """Take the momentum last seen for that of another inertia, at the velocity that it was seen with.

    Args:
        observer: `observer_dtype` record.
        M: joint inertia, (n, n), kg m².
        arm: of the state.
        rotor: inertia of the rotors, (n,), kg m².
        qd: the robot's own velocity then, (n,), rad/s.
    """
    momentum_into(M, qd, observer.momentum)
    if observer.velocity.of_positions != 0:
        momentum_into(M, observer.velocity.qd, observer.momentum)
    if arm.has_torque != 0:
        for i in range(rotor.shape[0]):
            observer.momentum[i] -= rotor[i] * observer.velocity.qd[i]


@inlined
def observe(
    observer: Record, arm: Record, clock: Record, step: Record, command: Record, dynamics: Record, params: Record,
) -> bool:  # fmt: skip
    """Raw external torque since the last good measurement, two observers of it, a low-pass behind each.

    It is a mean over the time that passed, in which what was commanded is known tick by tick.

    Args:
        observer: `observer_dtype` record; advanced.
        arm, clock, step, command: of the state.
        dynamics: of now.
        params: `params_dtype` record.

    Returns:
        Whether they went on: a measurement was there, and one to compare it with.
    """
    n = arm.q.shape[0]
    _add_impulse(observer, arm, clock.elapsed, command, dynamics)
    if clock.bridged > 0:
        return False
    velocity = observer.velocity
    # or the momentum of the rotors, or the difference of two velocities, would come or go at once
    same = observer.behind_gears == arm.has_torque and velocity.changed == 0
    p = _momentum_into(observer, dynamics.M, arm, params.arm.rotor, stack_vector(n))
    tau_external, rate, ramp, tau_tool = stack_vector(n), stack_vector(n), stack_vector(n), stack_vector(n)
    for i in range(n):
        ramp[i] = 0.0 if arm.has_torque != 0 else (command.tau[i] - observer.tau_before[i]) / clock.since
        impulse, ticks, between = observer.impulse[i], observer.impulse_ticks, clock.since
        if is_of_middle(velocity, i):  # and so is the impulse between two of them
            impulse, ticks = 0.5 * (impulse + observer.impulse_before[i]), velocity.between
            between = velocity.between
        rate[i] = (p[i] - observer.momentum[i]) / (between * params.clock.dt)
        tau_external[i] = rate[i] - impulse / ticks
        observer.impulse_before[i] = observer.impulse[i]
        observer.tau_before[i], observer.momentum[i], observer.impulse[i] = command.tau[i], p[i], 0.0
    observer.impulse_ticks = 0.0
    tau_tool[:] = 0.0
    if arm.has_wrench != 0 and params.observer.cancel_tool_wrench != 0:
        _tool_torque_into(observer, arm.wrench_ee, dynamics.J, clock.since, step, tau_tool)
    if clock.since > BRIDGE_TICKS + 1.5 or clock.unclear != 0 or not same:
        return False
    for i in range(n):
        tau_external[i] -= tau_tool[i]
    observer.raw[:] = tau_external
    observer_step(observer.residual_unfiltered, step.compensation_filter_gain, tau_external)
    observer_step(observer.residual_fast_unfiltered, step.detection_filter_gain, tau_external)
    observer_step(observer.momentum_rate_unfiltered, step.detection_filter_gain, rate)
    observer_step(observer.torque_ramp_unfiltered, step.detection_filter_gain, ramp)
    observer_step(observer.residual, step.lowpass_gain, observer.residual_unfiltered)
    observer_step(observer.residual_fast, step.lowpass_gain, observer.residual_fast_unfiltered)
    observer_step(observer.momentum_rate, step.lowpass_gain, observer.momentum_rate_unfiltered)
    observer_step(observer.torque_ramp, step.lowpass_gain, observer.torque_ramp_unfiltered)
    return True


@inlined
def _add_impulse(observer: Record, arm: Record, elapsed: float, command: Record, dynamics: Record) -> None:
    """Add what drove the arm in the ticks that passed, less β, the mean of then and now.

    That is the command less friction, or the mean of the torques measured then and now.
    """
    observer.impulse_ticks += elapsed
    measured = arm.has_torque != 0 and observer.behind_gears != 0
    for i in range(observer.beta.shape[0]):
        beta = dynamics.g[i] - dynamics.CT_qd[i]
        driving = command.tau[i] - command.friction[i]
        if measured:
            driving = 0.5 * (arm.torque[i] + observer.torque_before[i])
        observer.impulse[i] += elapsed * (driving - 0.5 * (beta + observer.beta[i]))
        observer.beta[i] = beta


@compiled
def _tool_torque_into(observer: Record, wrench: Vector, J: Matrix, since: float, step: Record, out: Vector) -> None:
    """Fill the measured tool wrench as joint torque, (n,), N m: of the last tick, and of those before it by its mean.

    What the tool felt in a gap nobody knows; it may be all that it felt of late. That is `tool_torque_unseen`, and dies
    out as it does in the observers.
    """
    matvec_t_into(J, wrench, out)
    fade = 1.0 - 0.4 * min(step.detection_filter_gain, step.lowpass_gain)
    for i in range(out.shape[0]):
        recent = (1.0 - step.tool_memory_gain) * observer.tool_torque_recent[i]
        observer.tool_torque_recent[i] = max(abs(out[i]), recent)
        observer.tool_torque_unseen[i] *= fade
    gap = 1.0 - 1.0 / since
    if gap > _GAP:
        before = matvec_t_into(J, observer.wrench_before, stack_vector(out.shape[0]))
        for i in range(out.shape[0]):
            unseen = 1.2 * gap * observer.tool_torque_recent[i]
            observer.tool_torque_unseen[i] = max(observer.tool_torque_unseen[i], unseen)
            out[i] += 0.5 * gap * (before[i] - out[i])
    observer.wrench_before[:] = wrench
