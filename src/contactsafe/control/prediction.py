"""What stands in for a measurement that is missing: the nominal dynamics predict where the arm is."""

from contactsafe.control.codes import FREE
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import matvec_into, matvec_t_into
from contactsafe.core.stack import stack_vector


@compiled
def predict(arm: Record, net: Vector, M_inv: Matrix, dt: float, known: Record) -> None:
    """Move the believed arm on by dt s: q̈ = M⁻¹ (tau − friction − c − g + tau_ext), the last contact going on.

    Args:
        arm: `arm_state_dtype` record; advanced.
        net: what `net_torque` gives, (n,), N m.
        M_inv: inverse joint inertia, (n, n), 1/(kg m²).
        dt: s.
        known: `arm_dtype` record, whose bounds hold.
    """
    n = net.shape[0]
    qdd = matvec_into(M_inv, net, stack_vector(n))
    for i in range(n):
        arm.qd[i] = min(max(arm.qd[i] + dt * qdd[i], -known.qd_most[i]), known.qd_most[i])
        arm.q[i] = min(max(arm.q[i] + dt * arm.qd[i], known.q_least[i]), known.q_most[i])


@compiled
def net_torque(state: Record, dynamics: Record, params: Record, out: Vector) -> Vector:
    """Fill what accelerates the arm by all that is known, (n,), N m, and return it.

    While braking no contact is counted on: what the arm pressed against lets go as it stops pressing.

    Args:
        state: `state_dtype` record; only read.
        dynamics: at the believed state.
        params: of the observer.
        out: (n,).
    """
    braking, touched = state.clock.braking, state.mode != FREE
    external = state.observer.residual_fast if touched else state.observer.residual
    out[:] = 0.0
    if state.arm.has_wrench != 0 and params.cancel_tool_wrench != 0 and braking == 0:
        matvec_t_into(dynamics.J, state.arm.wrench_ee, out)
    for i in range(out.shape[0]):
        if not (touched and braking != 0):
            out[i] += external[i]
        out[i] += state.command.tau[i] - state.command.friction[i] - dynamics.c[i] - dynamics.g[i]
    return out
