"""Observer: residuals, what acts on the arm from outside as torque at its joints, from momentum alone; (10)-(14)."""

import numpy as np

from contactsafe.control.laws import momentum_into, observer_step
from contactsafe.control.plausibility import BRIDGE_TICKS
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import matvec_t_into
from contactsafe.core.stack import stack_vector

_f = np.float64

_GAP = 0.3
"""Fraction of the time between two measurements in which the tool's wrench was not measured that counts as a gap."""


def observer_dtype(n: int) -> np.dtype:
    """Describe what the observer remembers."""
    return np.dtype(
        [
            ("residual", _f, (n,)),  # that the law compensates, N m
            ("residual_fast", _f, (n,)),  # that detects, N m
            ("residual_unfiltered", _f, (n,)),  # before their low-pass, N m
            ("residual_fast_unfiltered", _f, (n,)),
            ("momentum_rate", _f, (n,)),  # behind the filters of the fast residual, N m
            ("momentum_rate_unfiltered", _f, (n,)),
            ("torque_ramp", _f, (n,)),  # change of the command per tick behind the same filters, N m
            ("torque_ramp_unfiltered", _f, (n,)),
            ("momentum", _f, (n,)),  # at the last good measurement, kg m²/s
            ("beta", _f, (n,)),  # g − Cᵀ q̇ at the last tick, N m
            ("impulse", _f, (n,)),  # of the command less friction and β since the last good measurement, N m ticks
            ("impulse_ticks", _f),  # in so many ticks
            ("tau_before", _f, (n,)),  # command at the last good measurement, N m
            ("wrench_before", _f, (6,)),  # on the tool then, N and N m
            ("tool_torque_recent", _f, (n,)),  # largest torque of the tool's wrench of late, N m
            ("tool_torque_unseen", _f, (n,)),  # that a gap in the measurements may have hidden, N m
        ]
    )


@compiled
def start_observer(observer: Record, command: Record, dynamics: Record, qd: Vector) -> None:
    """Begin with the momentum of now, and a raw external torque of zero.

    What the torque last sent did is not known: all of it that the arm did not need is put down to friction this once.
    """
    momentum_into(dynamics.M, qd, observer.momentum)
    for i in range(qd.shape[0]):
        observer.beta[i] = dynamics.g[i] - dynamics.CT_qd[i]
        command.friction[i] = command.tau[i] - observer.beta[i]
        observer.tau_before[i] = command.tau[i]


@inlined
def observe(
    observer: Record, arm: Record, clock: Record, step: Record, command: Record, dynamics: Record, params: Record
) -> None:
    """Raw external torque since the last good measurement, two observers of it, a low-pass behind each.

    It is a mean over the time that passed, in which what was commanded is known tick by tick.

    Args:
        observer: `observer_dtype` record; advanced.
        arm, clock, step, command: of the state.
        dynamics: of now.
        params: `params_dtype` record.
    """
    n = arm.q.shape[0]
    _add_impulse(observer, clock.elapsed, command, dynamics)
    if clock.bridged > 0:
        return
    p = momentum_into(dynamics.M, arm.qd, stack_vector(n))
    tau_external, rate, ramp, tau_tool = stack_vector(n), stack_vector(n), stack_vector(n), stack_vector(n)
    for i in range(n):
        ramp[i] = (command.tau[i] - observer.tau_before[i]) / clock.since
        rate[i] = (p[i] - observer.momentum[i]) / (clock.since * params.clock.dt)
        tau_external[i] = rate[i] - observer.impulse[i] / observer.impulse_ticks
        observer.tau_before[i], observer.momentum[i], observer.impulse[i] = command.tau[i], p[i], 0.0
    observer.impulse_ticks = 0.0
    tau_tool[:] = 0.0
    if arm.has_wrench != 0 and params.observer.cancel_tool_wrench != 0:
        _tool_torque_into(observer, arm.wrench_ee, dynamics.J, clock.since, step, tau_tool)
    if clock.since > BRIDGE_TICKS + 1.5 or clock.unclear != 0:
        return
    for i in range(n):
        tau_external[i] -= tau_tool[i]
    observer_step(observer.residual_unfiltered, step.compensation_filter_gain, tau_external)
    observer_step(observer.residual_fast_unfiltered, step.detection_filter_gain, tau_external)
    observer_step(observer.momentum_rate_unfiltered, step.detection_filter_gain, rate)
    observer_step(observer.torque_ramp_unfiltered, step.detection_filter_gain, ramp)
    observer_step(observer.residual, step.lowpass_gain, observer.residual_unfiltered)
    observer_step(observer.residual_fast, step.lowpass_gain, observer.residual_fast_unfiltered)
    observer_step(observer.momentum_rate, step.lowpass_gain, observer.momentum_rate_unfiltered)
    observer_step(observer.torque_ramp, step.lowpass_gain, observer.torque_ramp_unfiltered)


@inlined
def _add_impulse(observer: Record, elapsed: float, command: Record, dynamics: Record) -> None:
    """Add what the command did in the ticks that passed, less friction and β, the mean of then and now."""
    observer.impulse_ticks += elapsed
    for i in range(observer.beta.shape[0]):
        beta = dynamics.g[i] - dynamics.CT_qd[i]
        applied = command.tau[i] - command.friction[i] - 0.5 * (beta + observer.beta[i])
        observer.impulse[i] += elapsed * applied
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
