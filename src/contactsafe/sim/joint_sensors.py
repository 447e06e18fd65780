"""Sensors at the joints as real arms have them: velocity with noise of a band, torque behind the gears; compiled."""

import functools
import math

import numpy as np

from contactsafe.control.laws import filter_gain
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.stack import stack_vector
from contactsafe.robot.friction import joint_drag_into

_f = np.float64
_i = np.int64

BAND_HZ = (5.0, 50.0)
"""In which a real Panda's velocity signal is noisy."""


@functools.cache
def joint_sensors_dtype(n: int) -> np.dtype:
    """Describe the sensors at the joints of one world, and what they remember."""
    return np.dtype(
        [
            ("band_sigma", _f),  # of what drives the noise of velocity, rad/s
            ("band", _f, (n, 2)),  # that noise behind its low-pass, and the part of it below the band, rad/s
            ("has_torque", _i),
            ("torque_sigma", _f),  # N m
            ("torque_bias", _f, (n,)),  # N m
            ("play", _f),  # half the width of the hysteresis, N m
            ("rotor", _f, (n,)),  # inertia before the sensor, kg m²
            ("friction", _f, (n, 3)),  # that is shown beside the torque: N m, s/rad, rad/s
            ("drag", _f, (n, 3)),  # likewise, N m s/rad, N m and N m
            ("torque_held", _f, (n,)),  # that the hysteresis shows, N m
            ("qd_before", _f, (n,)),  # of the plant a tick ago, rad/s
        ]
    )


def band_gain(tick_s: float) -> float:
    """Return by how much white noise is to be larger than what `velocity_noise` makes of it."""
    low, high = (filter_gain(2.0 * math.pi * hz, tick_s) for hz in BAND_HZ)
    smooth, slow, power = 0.0, 0.0, 0.0
    for k in range(10_000):
        smooth += high * (float(k == 0) - smooth)
        slow += low * (smooth - slow)
        power += (smooth - slow) ** 2
    return 1.0 / math.sqrt(power)


@compiled
def velocity_noise(joints: Record, i: int, white: float, dt: float) -> float:
    """Advance the noise of joint i's velocity by one tick and return it, rad/s: white noise within `BAND_HZ`."""
    band = joints.band
    band[i, 0] += filter_gain(2.0 * math.pi * BAND_HZ[1], dt) * (joints.band_sigma * white - band[i, 0])
    band[i, 1] += filter_gain(2.0 * math.pi * BAND_HZ[0], dt) * (band[i, 0] - band[i, 1])
    return band[i, 0] - band[i, 1]


@compiled
def sense_torque(world: Record, measurement: Record, noise: Vector, dt: float) -> None:
    """Fill the torque measured behind the gears: motor less friction, less what the rotors took, over the last tick.

    Args:
        world: `world_dtype` record, with what drove the last tick.
        measurement: `measurement_dtype` record.
        noise: standard normal numbers, (at least n,).
        dt: s.
    """
    joints, truth = world.errors.joints, world.truth
    beside = stack_vector(measurement.torque.shape[0])
    joint_drag_into(joints.friction, joints.drag, truth.qd, beside)
    for i in range(measurement.torque.shape[0]):
        torque = world.motor[i] - world.drag[i]
        torque -= joints.rotor[i] * (truth.qd[i] - joints.qd_before[i]) / dt
        joints.qd_before[i] = truth.qd[i]
        held = joints.torque_held[i]
        held = min(max(held, torque - joints.play), torque + joints.play)
        joints.torque_held[i] = held
        measurement.torque[i] = held + joints.torque_bias[i] + joints.torque_sigma * noise[i] + beside[i]
    measurement.has_torque = 1
