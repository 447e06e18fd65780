"""A force/torque sensor under the arm's base, with noise and bias; compiled."""

import numpy as np

from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.sim.config import SensorConfig

_f = np.float64
_i = np.int64

base_sensor_dtype = np.dtype(
    [
        ("present", _i),
        ("force_sigma", _f),  # N
        ("moment_sigma", _f),  # N m
        ("bias", _f, (6,)),  # constant of an episode, N and N m
        ("channel", _i),  # of its first random number
    ]
)
"""The sensor of one world."""

CHANNELS = 6
"""Random numbers that one tick needs."""


def fill_base_sensor(base: Record, sensors: SensorConfig, channel: int) -> None:
    """Fill a `base_sensor_dtype` record.

    Args:
        base: the record.
        sensors: of the world.
        channel: of the first random number that it may use.
    """
    base["present"], base["channel"] = sensors.base, channel
    base["force_sigma"], base["moment_sigma"] = sensors.base_force_n, sensors.base_moment_nm


def sample_base_bias(base: Record, sensors: SensorConfig, rng: np.random.Generator) -> None:
    """Sample the bias of an episode; nothing without a sensor."""
    if sensors.base:
        base["bias"][:3] = sensors.base_force_bias_n * rng.standard_normal(3)
        base["bias"][3:] = sensors.base_moment_bias_nm * rng.standard_normal(3)


@compiled
def sense_base(base: Record, wrench: Vector, measurement: Record, noise: Vector) -> None:
    """Fill the measured wrench at the base.

    Args:
        base: `base_sensor_dtype` record of a sensor that is present.
        wrench: true one, of the arm on its base, (6,), N and N m.
        measurement: `measurement_dtype` record.
        noise: standard normal numbers of all sensors.
    """
    for k in range(6):
        sigma = base.force_sigma if k < 3 else base.moment_sigma
        measurement.wrench_base[k] = wrench[k] + base.bias[k] + sigma * noise[base.channel + k]
    measurement.has_base = 1
