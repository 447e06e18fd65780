"""Classification: whether a contact is an obstacle, a push on the arm, or the tool's own.

An obstacle and a push look alike to the residual. They differ in what receding brings: the torque of an obstacle
falls, that of a push goes on. `docs/concepts/control.md` has the states.
"""

import math

import numpy as np

from contactsafe.control.codes import COMPLY, NO_CONTACT, OBSTACLE, PUSH, REJECT, TOOL
from contactsafe.control.laws import observer_step
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot

_f = np.float64

_CERTAIN = 4.0
"""A push once classified is one until so many times the probing displacement speaks for an obstacle."""


def classification_dtype(n: int) -> np.dtype:
    """Describe what classification remembers of the contact."""
    return np.dtype(
        [
            ("velocity", _f, (n,)),  # of the joints behind the filters of the fast residual, in step with it, rad/s
            ("velocity_unfiltered", _f, (n,)),  # before the low-pass, rad/s
            ("displacement_rad", _f),  # by which the arm has receded along the contact's direction since the reference
            ("displacement_smooth_rad", _f),  # the same, smoothed
            ("torque_smooth_nm", _f),  # contact torque along its direction, smoothed
            ("reference_nm", _f),  # the same at the reference: where the arm last stopped moving into the contact
            ("decision_rad", _f),  # displacement at which the contact is classified next
        ]
    )


@inlined
def follow_velocity(classification: Record, qd: Vector, step: Record) -> None:
    """Filter the joint velocity as the torque is, or the torque's lag would look like a push."""
    observer_step(classification.velocity_unfiltered, step.detection_filter_gain, qd)
    observer_step(classification.velocity, step.lowpass_gain, classification.velocity_unfiltered)


@compiled
def begin_classification(classification: Record) -> None:
    """Begin with a contact of which nothing is known."""
    classification.displacement_rad, classification.displacement_smooth_rad = 0.0, 0.0
    classification.torque_smooth_nm, classification.reference_nm = 0.0, 0.0
    classification.decision_rad = math.inf


@inlined
def classify(classification: Record, isolation: Record, torque: Vector, mode: int, step: Record, params: Record) -> int:
    """Return what the contact has shown itself to be in this tick: OBSTACLE, PUSH, or NO_CONTACT for nothing new.

    Args:
        classification: `classification_dtype` record; advanced.
        isolation: up to date; the longest lever arm is probed with, a short guess would let the arm be carried away.
        torque: of the contact on the arm, (n,), N m.
        mode, step: in force.
        params: of classification.
    """
    _follow_contact(classification, isolation.direction, torque, step)
    displacement, probe = classification.displacement_smooth_rad, params.probe_m / isolation.lever_max
    if displacement <= 0.0:  # the arm moves into it
        classification.displacement_rad -= displacement
        classification.displacement_smooth_rad = 0.0
        classification.reference_nm = classification.torque_smooth_nm
        classification.decision_rad, displacement = probe, 0.0
    classification.decision_rad = min(classification.decision_rad, displacement + probe)
    if displacement < classification.decision_rad:
        return NO_CONTACT
    classification.decision_rad = displacement + probe
    drop = classification.reference_nm - classification.torque_smooth_nm
    if is_push(drop, displacement, isolation.lever, params.obstacle_stiffness_min):
        return PUSH
    return NO_CONTACT if mode == REJECT and displacement < _CERTAIN * probe else OBSTACLE


@inlined
def _follow_contact(classification: Record, direction: Vector, torque: Vector, step: Record) -> None:
    """Follow how far the arm has receded along the contact, and the contact's torque meanwhile."""
    classification.displacement_rad += step.dt * dot(direction, classification.velocity)
    along = dot(direction, torque)
    classification.torque_smooth_nm += step.probe_gain * (along - classification.torque_smooth_nm)
    change = classification.displacement_rad - classification.displacement_smooth_rad
    classification.displacement_smooth_rad += step.probe_gain * change


@compiled
def is_push(drop: float, displacement: float, lever: float, stiffness: float) -> bool:
    """Tell a push on the arm from an obstacle in its path, by what receding from it brings.

    The torque of a spring of k N/m at a lever arm of l falls by k l² for every radian that the arm recedes; a push goes
    on. Half the fall that the softest obstacle would show draws the line.

    Args:
        drop: by which the contact's torque has fallen, N m.
        displacement: by which the arm has receded along the contact's direction meanwhile, rad.
        lever: of the contact, m.
        stiffness: of the softest thing that counts as an obstacle, N/m.
    """
    return drop < 0.5 * stiffness * lever * lever * displacement


@compiled
def contact_kind(mode: int, tool_force: Vector, tool_contact_n: float) -> int:
    """Return what touches the arm or its tool: a key of `KINDS`. A contact of the arm comes before one of the tool."""
    if mode == COMPLY:
        return OBSTACLE
    if mode == REJECT:
        return PUSH
    return TOOL if math.sqrt(dot(tool_force, tool_force)) >= tool_contact_n else NO_CONTACT
