"""Payload: what the tool carries, taken off the measured wrench where it is known, identified where it is not.

A body of mass m and centre p, in the tool's frame R, puts g_load = −Jᵥᵀ m γ − J_ωᵀ (R m p × γ) on the joints, γ being
gravity: linear in (m, m p). So one joint's torque at rest is one reading of four numbers.
"""

import math

import numpy as np

from contactsafe.control.laws import identify_masses
from contactsafe.control.link_masses import CORRELATED, NOISE_NM
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import cross_into, dot, matvec_into, matvec_t_into
from contactsafe.core.stack import stack_vector

_f = np.float64
_i = np.int64

_MASS_SIGMA_KG, _MOMENT_SIGMA_KG_M = 3.0, 0.15
"""What is expected of a load before it is identified: standard deviations of its mass, and of mass times centre."""

_LARGEST = np.array([100.0, 20.0, 20.0, 20.0])

_FORGET_S = 30.0
"""Time after which what was identified and shows no more, in another posture, is forgotten."""

_SLOW_RAD_S = 1.0
"""Joints that are faster tell of inertia and friction, not of weight."""

_SETTLE_S = 0.2
"""Until then the observer shows what was before."""

_SMOOTH_S = 0.3
"""Time over which it is decided whether a load explains the torques: each joint is read many times in it."""

_UNEXPLAINED = 0.25
"""A load explains the torques but for this fraction of their squares."""

_TOLD = 0.5
"""Mean square of the torques, in units of their error, from which they say anything."""

_REACH_M = 0.4
"""A tool carries nothing whose centre is further from its point."""

_SAGS_M = 0.008
_SAGS_S = 1.0
_LOST = 0.4
"""A tool that misses this much of what it is said to carry does not merely press on something."""

_RISES_M_S = 0.01
"""A tool that a load keeps so far below its target for so long, and that rises no faster, is a fault."""


known_payload_dtype = np.dtype(
    [
        ("mass", _f),  # kg
        ("com", _f, (3,)),  # in the tool's frame, m
        ("inertia", _f, (3, 3)),  # about it, in the tool's axes, kg m²
        ("in_wrench", _i),  # 1 where the measured wrench has its weight in it
    ]
)
"""What the tool is known to carry; the handle's model has it."""

payload_dtype = np.dtype(
    [
        ("momentum", _f, (6,)),  # of the known payload at the last good measurement, kg m/s and kg m²/s
        ("load", _f, (4,)),  # beyond the known payload: mass, and mass times centre in the tool's frame, kg and kg m
        ("covariance", _f, (4, 4)),
        ("torque_square", _f),  # smoothed square of what acts from outside, in units of its error
        ("unexplained_square", _f),  # the same of what the load does not explain
        ("slow_s", _f),  # time since a joint was fast, s
        ("is_load", _i),  # 1 where what acts is such a load
        ("sags_s", _f),  # time for which it has kept the tool below its target, s
    ]
)
"""What is remembered of the payload."""


@compiled
def take_off_payload(
    payload: Record, arm: Record, known: Record, dynamics: Record, gravity: Vector, seconds: float, started: int
) -> None:
    """Take the known payload's weight and inertial force off a measured wrench that has them in it.

    The wrench of the environment is what the sensor shows less (m γ − ṗ, r × m γ − L̇ − v × p), with the payload's
    momentum p and L about the tool point, r from there to its centre, v the tool point's velocity. The rates are
    differences between two measurements, as the observer's is: what one of them errs, the other does.

    Args:
        payload: `payload_dtype` record; its momentum is advanced.
        arm: `arm_state_dtype` record; its wrench is changed.
        known: `known_payload_dtype` record.
        dynamics: of now.
        gravity: (3,), m/s².
        seconds, started: since the last good measurement; 0 where there is none.
    """
    momentum, weight, turning = stack_vector(6), stack_vector(6), stack_vector(3)
    payload_weight_into(known, dynamics.rotation, gravity, weight)
    payload_momentum_into(known, dynamics, momentum)
    if arm.has_wrench != 0:
        cross_into(dynamics.velocity[:3], momentum[:3], turning)
        for k in range(6):
            rate = (momentum[k] - payload.momentum[k]) / seconds if started != 0 else 0.0
            arm.wrench_ee[k] += rate - weight[k]
        arm.wrench_ee[3:] += turning
    payload.momentum[:] = momentum


@compiled
def payload_weight_into(load: Record, rotation: Matrix, gravity: Vector, out: Vector) -> Vector:
    """Fill the weight of what the tool carries as a wrench at the tool point, world axes, (6,), N and N m."""
    r = matvec_into(rotation, load.com, stack_vector(3))
    for k in range(3):
        out[k] = load.mass * gravity[k]
    cross_into(r, out[:3], out[3:])
    return out


@compiled
def payload_momentum_into(load: Record, dynamics: Record, out: Vector) -> Vector:
    """Fill the momentum of what the tool carries, and that about the tool point, world axes, (6,)."""
    R, v, omega = dynamics.rotation, dynamics.velocity[:3], dynamics.velocity[3:]
    r = matvec_into(R, load.com, stack_vector(3))
    swing = cross_into(omega, r, stack_vector(3))
    for k in range(3):
        out[k] = load.mass * (v[k] + swing[k])
    spin = matvec_into(load.inertia, matvec_t_into(R, omega, stack_vector(3)), stack_vector(3))
    matvec_into(R, spin, out[3:])
    out[3:] += cross_into(r, out[:3], swing)
    return out


@compiled
def reset_payload(payload: Record) -> None:
    """Begin anew to identify what the tool carries beyond what is known."""
    payload.load[:] = 0.0
    payload.covariance[:] = 0.0
    for k in range(4):
        payload.covariance[k, k] = _prior(k)
    payload.torque_square, payload.unexplained_square, payload.slow_s, payload.sags_s = 0.0, 0.0, 0.0, 0.0
    payload.is_load = 0


@compiled
def _prior(k: int) -> float:
    return _MASS_SIGMA_KG**2 if k == 0 else _MOMENT_SIGMA_KG_M**2


@compiled
def load_regressor_into(dynamics: Record, gravity: Vector, i: int, row: Vector) -> Vector:
    """Fill the gravity torque at joint i of a load per its mass and mass times centre, (4,), m² / s² and m / s²."""
    J, R = dynamics.J, dynamics.rotation
    axis, arm = stack_vector(3), stack_vector(3)
    row[0] = 0.0
    for k in range(3):
        row[0] -= J[k, i] * gravity[k]
        axis[k] = J[3 + k, i]
    cross_into(axis, gravity, arm)  # −J_ω · (R m p × γ) = (J_ω × γ) · R m p
    matvec_t_into(R, arm, row[1:])
    return row


@compiled
def is_settled(payload: Record, qd: Vector, dt: float) -> bool:
    """Tell whether the arm has been slow for long enough to identify what it carries; else begin to wait anew."""
    payload.slow_s = payload.slow_s + dt if _is_slow(qd) else 0.0
    if payload.slow_s < _SETTLE_S:
        payload.is_load, payload.sags_s = 0, 0.0
        return False
    return True


@compiled
def identify_payload(
    payload: Record, row: Vector, torque: float, uncertainty: float, dry_friction: float, dt: float, known_kg: float
) -> None:
    """Identify what the tool carries beyond the model from the torque of one joint, while the arm is slow.

    Args:
        payload: `payload_dtype` record; advanced.
        row: what `load_regressor_into` gives for the joint, (4,).
        torque: all that acts on it from outside, also on the tool, N m.
        uncertainty: of the model's torque there, N m.
        dry_friction: of the joint; at rest it takes any part of itself, N m.
        dt: that passed, s.
        known_kg: mass of the known payload.
    """
    error = NOISE_NM + uncertainty
    error += 0.5 * dry_friction
    _identify_load(payload, row, torque, error, dt)
    payload.is_load = 1 if _is_load(payload, known_kg) else 0


@compiled
def _identify_load(payload: Record, row: Vector, torque: float, error: float, dt: float) -> None:
    """Take one joint's torque into the estimate of the load, and into what tells whether a load explains it."""
    forgotten = dt / _FORGET_S
    for k in range(4):
        payload.load[k] *= 1.0 - forgotten
        payload.covariance[k, k] = min(payload.covariance[k, k] + forgotten * _prior(k), _prior(k))
    news = -torque - dot(row, payload.load)
    gain = min(dt / _SMOOTH_S, 1.0)
    payload.torque_square += gain * ((torque / error) ** 2 - payload.torque_square)
    payload.unexplained_square += gain * ((news / error) ** 2 - payload.unexplained_square)
    identify_masses(payload.load, payload.covariance, row, news, CORRELATED * error * error, _LARGEST)


@compiled
def _is_slow(qd: Vector) -> bool:
    for i in range(qd.shape[0]):
        if abs(qd[i]) > _SLOW_RAD_S:
            return False
    return True


@compiled
def _is_load(payload: Record, known_kg: float) -> bool:
    """Tell whether what acts on the arm is the weight of a body in the tool, or of one that is gone."""
    mass, moment = payload.load[0], payload.load[1:]
    unexplained = payload.unexplained_square > _UNEXPLAINED * payload.torque_square
    if payload.torque_square < _TOLD or unexplained or mass < -1.2 * known_kg:
        return False
    return math.sqrt(dot(moment, moment)) < _REACH_M * abs(mass)


@compiled
def load_sags(payload: Record, error: Vector, velocity: Vector, gravity: Vector, known_kg: float, dt: float) -> bool:
    """Tell whether a load that nobody told of keeps the tool below its target, or lets it sink, for long.

    Or above, where what the tool is said to carry is not there.

    Args:
        payload: `payload_dtype` record; its time is advanced.
        error: of the tool, target less position, where it is held, (3,), m.
        velocity: of the tool, (3,), m/s.
        gravity: (3,), m/s².
        known_kg: mass of the known payload.
        dt: that passed, s.
    """
    size = math.sqrt(dot(error[:3], error[:3]))
    side = 1.0 if payload.load[0] > 0.0 else -1.0
    down = side * max(math.sqrt(dot(gravity, gravity)), 1e-9)
    against, sinking = -dot(error[:3], gravity) / down, dot(velocity[:3], gravity) / down
    much = payload.load[0] > 0.0 or -payload.load[0] > _LOST * known_kg
    sags = payload.is_load != 0 and much and size > _SAGS_M and against > 0.5 * size and sinking > -_RISES_M_S
    payload.sags_s = payload.sags_s + dt if sags else 0.0
    return payload.sags_s > _SAGS_S
