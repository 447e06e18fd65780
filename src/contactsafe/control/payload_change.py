"""Another payload amid a motion: all that is estimated goes over to it without a step."""

import numpy as np

from contactsafe.control.base_wrench import forget_base
from contactsafe.control.codes import FREE, LOAD
from contactsafe.control.link_masses import reset_link_masses
from contactsafe.control.observer import rebase_momentum
from contactsafe.control.payload import payload_momentum_into, payload_weight_into, reset_payload
from contactsafe.control.supervision import switch
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot
from contactsafe.core.stack import stack_vector
from contactsafe.robot.dynamics import update_dynamics


@compiled(nogil=True)
def take_up(controllers: np.ndarray, index: int, weight: Vector) -> None:
    """Go over to another payload, model and all, without a step in what is estimated.

    Args:
        controllers: array of records whose handle and payload are the new ones already.
        index: which of them.
        weight: of what was carried before, as a wrench at the tool point, (6,), N and N m.
    """
    c = controllers[index]
    state, observer, dynamics, n = c.state, c.state.observer, c.dynamics, c.state.command.tau.shape[0]
    change = stack_vector(n)
    change[:] = dynamics.g
    update_dynamics(c.handle, state.clock.q_good, state.clock.qd_good, dynamics)
    for i in range(n):
        change[i] = dynamics.g[i] - change[i]
        observer.beta[i] = dynamics.g[i] - dynamics.CT_qd[i]
        observer.impulse[i] -= observer.impulse_ticks * change[i]
    rebase_momentum(observer, dynamics.M, state.arm, c.params.arm.rotor, state.clock.qd_good)
    payload_momentum_into(c.payload, dynamics, state.payload.momentum)
    shown = _shown(observer.residual, change)
    _move(observer.residual, shown, change)
    _move(observer.residual_unfiltered, shown, change)
    shown_fast = _shown(observer.residual_fast, change)
    _move(observer.residual_fast, shown_fast, change)
    _move(observer.residual_fast_unfiltered, shown_fast, change)
    _move_tool_wrench(c, shown, weight)
    if shown_fast > 0.5:  # what was a contact was the load; what else there is shows at once
        switch(state, FREE)
    reset_link_masses(state.link_masses, c.params.identification.mass_variance)
    reset_payload(state.payload)
    forget_base(state.base)
    if state.fault == LOAD:
        state.fault = 0


@compiled
def _move_tool_wrench(c: Record, shown: float, weight: Vector) -> None:
    """Take the change of the payload's weight off the tool's wrench as far as it is in it."""
    tool, new_weight = c.state.tool_wrench, stack_vector(6)
    payload_weight_into(c.payload, c.dynamics.rotation, c.handle.gravity, new_weight)
    for k in range(6):
        tool.wrench[k] -= shown * (new_weight[k] - weight[k])
    if c.state.arm.has_wrench == 0:
        for k in range(3):
            tool.force[k] -= shown * (new_weight[k] - weight[k])


@compiled
def _move(vector: Vector, fraction: float, change: Vector) -> None:
    for i in range(vector.shape[0]):
        vector[i] += fraction * change[i]


@compiled
def _shown(residual: Vector, change: Vector) -> float:
    """Return the fraction of a change of gravity torque that the residual shows already: it was carried all along."""
    size = dot(change, change)
    return min(max(-dot(residual, change) / size, 0.0), 1.0) if size > 0.0 else 0.0
