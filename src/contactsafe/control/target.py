"""Targets: taken over where they are sound, refused with a reason where they are not."""

import math

from contactsafe.control.codes import BAD_GAIN, BAD_QUATERNION, BAD_TARGET
from contactsafe.control.plausibility import all_usable
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot


@inlined
def accept_target(held: Record, target: Record, params: Record) -> int:
    """Take a target over where it is new and sound; return the fault where it is not, 0 for none.

    Args:
        held: `target_dtype` record; replaced.
        target: another.
        params: of impedance.
    """
    if target.kept != 0:
        return 0
    fault = target_fault(target, params)
    if fault != 0:
        return fault
    norm = math.sqrt(dot(target.quat, target.quat))
    for i in range(4):
        held.quat[i] = target.quat[i] / norm
    held.position[:] = target.position
    held.K_task[:] = target.K_task
    held.D_task[:] = target.D_task
    held.q_posture[:] = target.q_posture
    return 0


@compiled
def target_fault(target: Record, params: Record) -> int:
    """Return why a record with a target's fields is not sound, 0 where it is; `params` are those of impedance."""
    usable = all_usable(target.position) and all_usable(target.quat) and all_usable(target.q_posture)
    if not (usable and all_usable(target.K_task) and all_usable(target.D_task)):
        return BAD_TARGET
    if abs(dot(target.quat, target.quat) - 1.0) > 2e-3:
        return BAD_QUATERNION
    for i in range(6):
        free = target.K_task[i] == 0.0
        if not (free or _within(target.K_task[i], params.stiffness_range)):
            return BAD_GAIN
        if not _within(target.D_task[i], params.damping_range):
            return BAD_GAIN
    return 0


@compiled
def _within(value: float, bounds: Vector) -> bool:
    return bounds[0] <= value <= bounds[1]
