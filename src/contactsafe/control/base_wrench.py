"""Base wrench: the wrench of all contacts together, by a sensor under the base, as far as it is known.

The arm's rate of momentum is the sum of its weight, of what touches it and of what its base exerts: f = ṗ − w + F, with
the momentum p, the weight w and the wrench F that the arm exerts on its base, each about the world's origin. The rates
are differences between two measurements, behind the filters of the fast residual: the two are of one time. No law reads
what stands here.
"""

import numpy as np

from contactsafe.control.laws import observer_step
from contactsafe.control.plausibility import BRIDGE_TICKS
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import cross_into
from contactsafe.core.stack import stack_vector
from contactsafe.robot.base_dynamics import arm_momentum_into, arm_weight_into

_f = np.float64
_i = np.int64

_SETTLE_S = 0.1
"""Of an arm that is not at rest the filters begin with what accelerates it; so long nothing is learned."""


def base_wrench_dtype(n: int) -> np.dtype:
    """Describe what is remembered of the wrench at the base."""
    return np.dtype(
        [
            ("started", _i),  # 1 once a measurement was taken
            ("told", _i),  # 1 where `wrench` is known
            ("momentum", _f, (6,)),  # of the arm at the last good measurement, kg m/s and kg m²/s
            ("balance", _f, (6,)),  # F − w then, less the tool's wrench where a sensor tells it, N and N m
            ("impulse_before", _f, (6,)),  # of it between the two measurements before, N ticks and N m ticks
            ("unfiltered", _f, (6,)),  # external wrench before the low-pass
            ("residual", _f, (6,)),  # behind it, N and N m
            ("rate_unfiltered", _f, (6,)),  # rate of momentum before the low-pass
            ("rate", _f, (6,)),  # behind it, N and N m
            ("offset", _f, (6,)),  # of the residual while nothing touches, N and N m
            ("variance", _f, (6,)),  # of the residual about it, N² and N² m²
            ("regressor", _f, (3, n + 1)),  # of `weight_moment_regressor`, where the offset was learned, N m
            ("seconds", _f),  # for which it was learned; less than 0 until the filters have settled
            ("wrench", _f, (6,)),  # external, about the world's origin, world axes, N and N m
            ("sigma", _f, (6,)),  # its standard deviation
        ]
    )


@compiled
def forget_base(base: Record) -> None:
    """Begin anew: another model of the arm, or no sensor."""
    base.started, base.told, base.seconds = 0, 0, 0.0


@compiled
def observe_base(base: Record, handle: Record, state: Record, dynamics: Record, params: Record) -> None:
    """Follow the external wrench as the base shows it, from a measurement that is not bridged.

    Args:
        base: `base_wrench_dtype` record; advanced.
        handle: of the nominal model, up to date.
        state: with the velocity in force, and the step of this measurement.
        dynamics: of now.
        params: `params_dtype` record.
    """
    if state.arm.has_base == 0:
        forget_base(base)
        return
    momentum, balance = stack_vector(6), stack_vector(6)
    arm_momentum_into(handle, state.observer.velocity.qd, momentum)
    _balance_into(handle, state.arm, dynamics.position, params.observer.cancel_tool_wrench, balance)
    if base.started == 0:
        base.unfiltered[:], base.residual[:], base.variance[:] = balance, balance, 0.0
        base.rate_unfiltered[:], base.rate[:] = 0.0, 0.0
        base.impulse_before[:] = balance * state.clock.since
        base.started, base.seconds = 1, -_SETTLE_S
    else:
        _follow(base, state, momentum, balance, params.clock.dt)
    base.momentum[:], base.balance[:] = momentum, balance


@compiled
def _balance_into(handle: Record, arm: Record, position: Vector, cancel_tool_wrench: int, out: Vector) -> None:
    """Fill F − w, less the tool's wrench where a sensor tells it, about the world's origin, (6,)."""
    arm_weight_into(handle, out)
    for k in range(6):
        out[k] = arm.wrench_base[k] - out[k]
    if arm.has_wrench != 0 and cancel_tool_wrench != 0:
        at_tool = arm.wrench_ee
        turned = cross_into(position, at_tool[:3], stack_vector(3))
        for k in range(3):
            out[k] -= at_tool[k]
            out[3 + k] -= at_tool[3 + k] + turned[k]


@compiled
def _follow(base: Record, state: Record, momentum: Vector, balance: Vector, dt: float) -> None:
    """Advance the observer by the mean of the time that passed; nothing of a gap that is too long to be compared."""
    since, velocity, step = state.clock.since, state.observer.velocity, state.step
    raw, rate = stack_vector(6), stack_vector(6)
    for k in range(6):
        impulse = 0.5 * since * (balance[k] + base.balance[k])
        driving, between = impulse, since
        if velocity.of_positions != 0:  # velocities are those of the middle between two measurements
            driving, between = 0.5 * (impulse + base.impulse_before[k]), velocity.between
        rate[k] = (momentum[k] - base.momentum[k]) / (between * dt)
        raw[k] = rate[k] + driving / between
        base.impulse_before[k] = impulse
    if since > BRIDGE_TICKS + 1.5 or state.clock.unclear != 0 or velocity.changed != 0:
        return
    observer_step(base.unfiltered, step.detection_filter_gain, raw)
    observer_step(base.rate_unfiltered, step.detection_filter_gain, rate)
    observer_step(base.residual, step.lowpass_gain, base.unfiltered)
    observer_step(base.rate, step.lowpass_gain, base.rate_unfiltered)
