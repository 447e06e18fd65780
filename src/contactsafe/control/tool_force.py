"""Force at the tool: measured or what the residual says, and what the tool may press with against it."""

from contactsafe.control.codes import FREE
from contactsafe.control.contact_work import is_active
from contactsafe.control.detection import unknown_friction
from contactsafe.control.laws import observer_step
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import inlined
from contactsafe.core.linalg import dot, matvec_t_into
from contactsafe.core.stack import stack_vector

_PRESSED_J = 0.02
"""Work that what is at the tool must have taken before it is no push any more."""


@inlined
def follow_tool_force(
    tool: Record, arm: Record, mode: int, residual_fast: Vector, J_bar: Matrix, known: Record, gain: float
) -> None:
    """Smooth the force of the environment on the tool: measured, or without a sensor what the residual says, J#ᵀ r.

    r is less what friction that the model does not know may come to. While something touches the arm, it is the force
    of before and what has met the tool since.

    Args:
        tool: `tool_wrench_dtype` record; its force is updated.
        arm: of the state.
        mode: of the controller.
        residual_fast: r, (n,), N m.
        J_bar: J#, (n, 6).
        known: `arm_dtype` record; what its unknown friction may be no force has to explain.
        gain: of the smoothing.
    """
    wrench = stack_vector(6)
    if arm.has_wrench != 0:
        wrench[:] = arm.wrench_ee
    elif mode != FREE:
        wrench[:] = tool.wrench
        wrench[:3] += tool.in_contact.force
    else:
        felt = _beyond_friction_into(residual_fast, arm, known, stack_vector(residual_fast.shape[0]))
        matvec_t_into(J_bar, felt, wrench)
    observer_step(tool.force, gain, wrench[:3])


@inlined
def _beyond_friction_into(residual: Vector, arm: Record, known: Record, out: Vector) -> Vector:
    """Fill what of a residual is more than friction that the model does not know, (n,), N m, and give it back."""
    for i in range(residual.shape[0]):
        unknown = unknown_friction(i, arm, known)
        out[i] = residual[i] - min(max(residual[i], -unknown), unknown)
    return out


@inlined
def follow_tool_limit(tool: Record, arm: Record, work: Record, contact_n: float, params: Record) -> float:
    """Return what the tool may press with, N: as much as a push is resisted with, where one may be at the tool.

    Without a sensor a push on the arm whose line passes the tool is like a contact of the tool. One that does work on
    the arm is resisted as any push on the arm; what the tool runs into is pressed with no more for it.

    Args:
        tool: `tool_wrench_dtype` record, its force up to date; `may_be_pushed` is updated.
        arm: of the state.
        work: `contact_work_dtype` record, up to date.
        contact_n: least force that counts as contact, N.
        params: of reaction.
    """
    if arm.has_wrench != 0 or dot(tool.force, tool.force) < contact_n * contact_n or work.taken_j > _PRESSED_J:
        tool.may_be_pushed = 0
    elif is_active(work):
        tool.may_be_pushed = 1
    resisted = max(params.tool_force_limit_n, params.reject_force_n)
    return resisted if tool.may_be_pushed != 0 else params.tool_force_limit_n
