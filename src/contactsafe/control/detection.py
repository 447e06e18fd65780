"""Detection: whether something touches the arm, a residual against a threshold of its own for each joint."""

import numpy as np

from contactsafe.control.noise import noise_left
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.stack import stack_vector
from contactsafe.robot.friction import joint_drag_into

_f = np.float64
_i = np.int64

GRAVITY_SIGMAS = 3.0
"""Standard deviations of the unidentified weight that a threshold allows for."""

GONE_S = 0.1
"""A contact that has been quiet for longer, s, is most probably gone, and not about to bounce back."""

_NOISE_SIGMAS = 6.0
"""Standard deviations of noise beyond what is allowed that a threshold allows for."""


def detection_dtype(n: int) -> np.dtype:
    """Describe what detection remembers."""
    return np.dtype(
        [
            ("residual", _f, (n,)),  # detection residual: what is held against the thresholds, N m
            ("threshold", _f, (n,)),  # N m
            ("model_uncertainty", _f, (n,)),  # of it, what friction, inertia and a late command may come to, N m
            ("contact_ticks", _i),  # since contact began or ended
            ("quiet_ticks", _i),  # since the residual was above what keeps a contact
        ]
    )


@inlined
def set_thresholds(
    detection: Record,
    observer: Record,
    gravity_sigma: Vector,
    arm: Record,
    CT_qd: Vector,
    params: Record,
) -> None:
    """Set each joint's threshold: δ plus what may be wrong with the model of the arm.

    Added are a fraction of the friction and what the model does not know of it, unless it lies before a sensor of
    torque; a fraction of the inertial torque; how far a command may have changed since the motors took it over; the
    change of the tool's wrench since it was measured last; a multiple of the standard deviation of the gravity torque
    that is not identified yet, and of noise that no filter keeps down.

    Args:
        detection: `detection_dtype` record; its thresholds are set.
        observer: `observer_dtype` record.
        gravity_sigma: standard deviation of the gravity torque, (n,), N m.
        arm: of the state.
        CT_qd: Cᵀ q̇, (n,), N m.
        params: `params_dtype` record.
    """
    known, allowed_nm = params.detection, params.observer.residual_noise_nm
    friction = joint_drag_into(params.arm.friction, params.arm.drag, arm.qd, stack_vector(CT_qd.shape[0]))
    before_sensor = 0.0 if arm.has_torque != 0 else known.friction_uncertainty
    for i in range(CT_qd.shape[0]):
        inertial = abs(observer.momentum_rate[i]) + abs(CT_qd[i])
        uncertainty = before_sensor * abs(friction[i] - params.arm.drag[i, 1]) + known.inertia_uncertainty * inertial
        uncertainty += unknown_friction(i, arm, params.arm)
        uncertainty += known.delay_uncertainty_ticks * abs(observer.torque_ramp[i]) + observer.tool_torque_unseen[i]
        detection.model_uncertainty[i] = uncertainty
        detection.threshold[i] = known.residual_threshold + uncertainty + GRAVITY_SIGMAS * gravity_sigma[i]
        detection.threshold[i] += _NOISE_SIGMAS * noise_left(observer.noise, i, allowed_nm)


@inlined
def unknown_friction(i: int, arm: Record, known: Record) -> float:
    """Return the most that a joint's friction may be beyond the model's, N m; none before a sensor of torque.

    Args:
        i: joint, from 0 on.
        arm: of the state.
        known: `arm_dtype` record.
    """
    if arm.has_torque != 0:
        return 0.0
    return known.friction_unknown[i, 0] * abs(arm.qd[i]) + known.friction_unknown[i, 1]


@inlined
def detect(detection: Record, in_contact: bool, presses: bool, ticks: int, params: Record) -> tuple[int, bool]:
    """Return the furthest link whose joint exceeds its threshold, and whether the arm is in contact from now on.

    Contact begins above the threshold; it ends after the dwell, once all joints have stayed below a fraction of it, or
    below all of it where nothing presses any more: what is left then is the model's, and who yields to it drifts away.

    Args:
        detection: `detection_dtype` record; its times are advanced.
        in_contact: whether the arm was in contact.
        presses: whether the torque along the contact's direction stands out.
        ticks: that passed.
        params: of detection.

    Returns:
        Link, 1 … n, 0 for none; and whether in contact.
    """
    link = _furthest_above(detection.residual, detection.threshold, 1.0)
    kept = _furthest_above(detection.residual, detection.threshold, params.release_fraction) if presses else link
    detection.contact_ticks += ticks
    detection.quiet_ticks = 0 if kept != 0 else detection.quiet_ticks + ticks
    if not in_contact:
        return link, link != 0
    released = detection.contact_ticks >= params.dwell_ticks and detection.quiet_ticks > params.release_ticks
    return link, not released


@compiled
def _furthest_above(residual: Vector, threshold: Vector, fraction: float) -> int:
    """Return the furthest joint from the base whose residual exceeds a fraction of its threshold, 1 … n; 0 for none."""
    for i in range(residual.shape[0] - 1, -1, -1):
        if abs(residual[i]) > fraction * threshold[i]:
            return i + 1
    return 0
