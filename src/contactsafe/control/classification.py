"""Classification: whether a contact is an obstacle, a push on the arm, or the tool's own.

An obstacle and a push look alike to the residual. They differ in who does work on whom, see `contact_work`, and in what
receding brings: the torque of an obstacle falls, that of a push goes on. `docs/concepts/control.md` has the states.
"""

import math

import numpy as np

from contactsafe.control.codes import COMPLY, NO_CONTACT, OBSTACLE, PUSH, REJECT, TOOL
from contactsafe.control.contact_work import is_active
from contactsafe.control.laws import observer_step
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot

_f = np.float64
_i = np.int64

_LEAST_J = 0.0005
"""The least that anything is thought to have taken."""

STANDS_OUT_NM = 0.4
"""Torque that noise does not show."""

_LOST = 0.5
"""Part of its torque that a push must lose before it is none."""

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
            ("reference_j", _f),  # work that the contact had taken at most by then
            ("furthest_rad", _f),  # by which the arm has receded at most since the reference
            ("decision_rad", _f),  # displacement at which the contact is asked again whether it goes on
            ("advanced_rad", _f),  # by which the arm has moved into the contact since it last receded
            ("before_nm", _f),  # contact torque before that
            ("came_off", _i),  # 1 once it has not pressed at all
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
    classification.torque_smooth_nm, classification.reference_nm, classification.reference_j = 0.0, 0.0, 0.0
    classification.advanced_rad, classification.before_nm = 0.0, 0.0
    classification.furthest_rad, classification.decision_rad, classification.came_off = 0.0, 0.0, 0


@inlined
def classify(
    classification: Record,
    isolation: Record,
    work: Record,
    torque: Vector,
    doubt_nm: float,
    mode: int,
    step: Record,
    params: Record,
) -> int:
    """Return what the contact has shown itself to be in this tick: OBSTACLE, PUSH, or NO_CONTACT for nothing new.

    Args:
        classification: `classification_dtype` record; advanced.
        isolation: up to date; the longest lever arm is probed with, a short guess would let the arm be carried away.
        work: `contact_work_dtype` record, up to date.
        torque: of the contact on the arm, (n,), N m.
        doubt_nm: by which the model's errors may have changed the contact's torque, N m.
        mode, step: in force.
        params: of classification.
    """
    _follow_contact(classification, isolation.direction, torque, step)
    active, probe = is_active(work), params.probe_m / isolation.lever_max
    softest = params.obstacle_stiffness_min * isolation.lever * isolation.lever
    if _comes_back(classification, _CERTAIN * probe):
        _advance(classification, work.taken_j, probe)
        if mode == REJECT and not active and _hinders(classification, probe, softest, doubt_nm):
            return OBSTACLE
    _follow_bounce(classification, work.taken_j, probe)
    if classification.displacement_smooth_rad > probe or active:
        classification.advanced_rad, classification.before_nm = 0.0, classification.torque_smooth_nm
    if classification.displacement_smooth_rad <= 0.0:
        return PUSH if active else NO_CONTACT
    return _receded(classification, active, doubt_nm, mode, probe, softest)


@inlined
def _comes_back(classification: Record, far: float) -> bool:
    """Tell whether the arm moves into the contact: on from where it last stopped, or far from where it receded to."""
    displacement = classification.displacement_smooth_rad
    classification.furthest_rad = max(classification.furthest_rad, displacement)
    return displacement <= 0.0 or displacement < classification.furthest_rad - far


@inlined
def _hinders(classification: Record, probe: float, softest: float, doubt_nm: float) -> bool:
    """Tell whether the torque has doubled since the arm last receded, as an obstacle's does when it is pressed."""
    rise, advanced = classification.torque_smooth_nm - classification.before_nm, classification.advanced_rad
    far = advanced > _CERTAIN * probe and rise > classification.before_nm
    return far and is_stiff(rise, advanced, softest, doubt_nm)


@inlined
def _receded(classification: Record, active: bool, doubt_nm: float, mode: int, probe: float, softest: float) -> int:
    """Return what the contact shows itself to be as the arm recedes."""
    displacement, before = classification.displacement_smooth_rad, classification.reference_nm
    drop = before - classification.torque_smooth_nm
    stiff = is_stiff(drop, displacement, softest, doubt_nm)
    if mode == REJECT and displacement > _CERTAIN * probe and drop > _LOST * before:
        return OBSTACLE if stiff else NO_CONTACT
    if mode == COMPLY and displacement > probe and stiff:
        return OBSTACLE
    if displacement > classification.decision_rad:
        classification.decision_rad = displacement + probe
        active = active or goes_on(drop, displacement, before, classification.reference_j, softest, doubt_nm)
    return PUSH if active else NO_CONTACT


@inlined
def _follow_bounce(classification: Record, taken_j: float, probe: float) -> None:
    """Begin anew as long as what came off and is back presses more and more: it may have bounced, and swing back."""
    if classification.torque_smooth_nm < 0.0:
        classification.came_off, classification.reference_nm = 1, 0.0
    if classification.came_off != 0 and classification.torque_smooth_nm > classification.reference_nm:
        _begin_here(classification, taken_j, probe)


@inlined
def _advance(classification: Record, taken_j: float, probe: float) -> None:
    """Begin anew where the arm moves into the contact."""
    classification.advanced_rad -= classification.displacement_smooth_rad
    _begin_here(classification, taken_j, probe)


@inlined
def _begin_here(classification: Record, taken_j: float, probe: float) -> None:
    """Compare what the arm recedes by from now on, and what that brings, with what there is now."""
    classification.displacement_rad -= classification.displacement_smooth_rad
    classification.displacement_smooth_rad, classification.furthest_rad, classification.decision_rad = 0.0, 0.0, probe
    classification.reference_nm, classification.reference_j = classification.torque_smooth_nm, taken_j


@inlined
def _follow_contact(classification: Record, direction: Vector, torque: Vector, step: Record) -> None:
    """Follow how far the arm has receded along the contact, and the contact's torque meanwhile."""
    classification.displacement_rad += step.dt * dot(direction, classification.velocity)
    along = dot(direction, torque)
    classification.torque_smooth_nm += step.probe_gain * (along - classification.torque_smooth_nm)
    change = classification.displacement_rad - classification.displacement_smooth_rad
    classification.displacement_smooth_rad += step.probe_gain * change


@compiled
def is_stiff(change: float, displacement: float, softest: float, doubt_nm: float) -> bool:
    """Tell an obstacle by its stiffness: the torque changes with the displacement, and the change stands out.

    Args:
        change: of the contact's torque, as a spring would change it, N m.
        displacement: of the arm along the contact's direction meanwhile, rad.
        softest: thing that counts as an obstacle, k l², N m/rad; half of that draws the line.
        doubt_nm: by which the model's errors may have changed the torque, N m.
    """
    return change > max(0.5 * softest * displacement, STANDS_OUT_NM + doubt_nm)


@compiled
def goes_on(drop: float, displacement: float, torque: float, taken_j: float, softest: float, doubt_nm: float) -> bool:
    """Tell a push on the arm from an obstacle in its path, by what receding from it brings.

    A spring that took A joules to come to a torque of τ loses τ² / (2 A) for every radian that the arm recedes; a push
    goes on. So does what is softer than anything that counts as an obstacle. Three quarters of that draw the line, and
    it must stand out.

    Args:
        drop: by which the contact's torque has fallen, N m.
        displacement: by which the arm has receded along the contact's direction meanwhile, rad.
        torque: of the contact before, N m.
        taken_j: work that it had taken at most before, J.
        softest: thing that counts as an obstacle, k l², N m/rad; half of it, for its lever arm is a guess.
        doubt_nm: by which the model's errors may have changed the torque, N m.
    """
    stiffness = max(0.5 * torque * torque / max(taken_j, _LEAST_J), 0.5 * softest)
    expected = min(stiffness * displacement, torque)
    return drop < 0.75 * expected - STANDS_OUT_NM - doubt_nm


@compiled
def contact_kind(mode: int, tool_force: Vector, tool_contact_n: float) -> int:
    """Return what touches the arm or its tool: a key of `KINDS`. A contact of the arm comes before one of the tool."""
    if mode == COMPLY:
        return OBSTACLE
    if mode == REJECT:
        return PUSH
    return TOOL if math.sqrt(dot(tool_force, tool_force)) >= tool_contact_n else NO_CONTACT
