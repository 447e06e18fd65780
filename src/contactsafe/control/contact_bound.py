"""Bound on the commanded contact force: how large it is, and what is lowered to keep to it.

Lowered are the compensation first, then, on an obstacle, the task as a whole, and last what is left, so also the
damping: elastic part and compensation are bounded each for itself, and damping may press as well.
"""

import math

from contactsafe.control.codes import LIMITED_BY_CONTACT, LIMITED_BY_TOOL_FORCE, REJECT
from contactsafe.control.laws import torque_against_contact
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import inlined
from contactsafe.core.linalg import dot

WHOLE = 0.99
"""A task scale this large leaves nothing out that anyone would notice."""


@inlined
def contact_limit(reaction: Record, isolation: Record, params: Record) -> float:
    """Return the bound in force, N m: a torque, and what a force comes to with the lever arm that isolation found."""
    comply = min(params.contact_torque_limit_comply_nm, params.contact_force_limit_comply_n * isolation.lever)
    reject = max(reaction.initial_limit_n * isolation.lever_max, reaction.reject_limit_nm)
    return max(comply, min(reject, params.contact_torque_limit_reject_nm))


@inlined
def reject_limit(torque_nm: float, isolation: Record, params: Record) -> float:
    """Return the bound with which a push is resisted at first, N m.

    Args:
        torque_nm: of the push along its direction, N m.
        isolation: up to date; a lever arm too long does no harm, one too short would let the push carry the arm away.
        params: of reaction.
    """
    return max(params.reject_force_n * isolation.lever_max, params.reject_margin * torque_nm)


@inlined
def follow_task_scale(reaction: Record, mode: int, wanted: float, reason: int, step: Record) -> None:
    """Let the task scale fall at once and come back slowly, fast in mode REJECT; say what lowered it."""
    if wanted < reaction.task_scale:
        reaction.task_scale, reaction.scale_reason = wanted, reason
    else:
        gain = step.reject_recover_gain if mode == REJECT else step.recover_gain
        reaction.task_scale += gain * (wanted - reaction.task_scale)
    if reaction.task_scale > WHOLE:
        reaction.scale_reason = reason


@inlined
def tool_task_scale(F_spring: Vector, force: Vector, contact_n: float, limit_n: float) -> tuple[float, int]:
    """Return the task scale with which the tool presses within a bound on what it touches, and its reason.

    Args:
        F_spring: task stiffness force, (6,), N and N m.
        force: of the environment on the tool, (3,), N.
        contact_n: least force that counts as contact, N; from twice as much on the bound is in force, between the two
            it comes down from infinity.
        limit_n: the bound, N.

    Returns:
        0 … 1; 1 without contact, or where the task presses less than the bound. And a key of LIMITS, 0 for none.
    """
    size = math.sqrt(dot(force, force))
    if size < contact_n:
        return 1.0, 0
    pressed = -dot(force, F_spring[:3]) / size * min((size - contact_n) / contact_n, 1.0)
    return (1.0, 0) if pressed <= limit_n else (limit_n / pressed, LIMITED_BY_TOOL_FORCE)


@inlined
def bound_compensation(compensation: Vector, direction: Vector, M_inv: Matrix, limit: float) -> float:
    """Scale a compensation in place so that it presses within a bound; return what it asked for, N m."""
    asked = torque_against_contact(direction, M_inv, compensation)
    if asked > limit:
        for i in range(compensation.shape[0]):
            compensation[i] *= limit / asked
    return asked


@inlined
def scale_of_task(elastic_push: float, left: float, scale: float, reason: int) -> tuple[float, int]:
    """Return the task scale with which the elastic part presses within what is left of a bound; its reason."""
    if elastic_push > 0.0 and left / elastic_push < scale:
        return left / elastic_push, LIMITED_BY_CONTACT
    return scale, reason


@inlined
def remove_excess(tau: Vector, direction: Vector, M_inv: Matrix, limit: float) -> None:
    """Take off a command in place what it presses along the contact beyond a bound, a (s − s_max)."""
    excess = torque_against_contact(direction, M_inv, tau) - limit
    if excess > 0.0:
        for i in range(tau.shape[0]):
            tau[i] += excess * direction[i]
