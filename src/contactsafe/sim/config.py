"""What a simulated world can be told: plant, sensors, fixtures, obstacles; frozen dataclasses with units."""

import math
from dataclasses import dataclass, field

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.fixtures import MAX_FIXTURES, Fixture, TipSurface, workbench
from contactsafe.sim.obstacles import MAX_OBSTACLES, Obstacle


@dataclass(frozen=True)
class PlantConfig:
    """How the simulated arm differs from what the controller believes.

    Attributes:
        friction_scale: joint friction as a multiple of the published one, one for all joints or one each; 0 for a
            frictionless arm.
        inertia_scale: masses and inertias of the links as a multiple of the nominal ones, one for all or one each.
        payload_kg: mass at the tool's centre that the controller does not know of; negative where the tool is lighter
            than the controller believes.
        torque_delay_ticks: ticks between a command and its effect (0 or 1).
        stiction_nm: dry friction that holds a joint at rest and brakes it in motion, beside the smooth friction above,
            N m, one for all or one each.
    """

    friction_scale: float | tuple[float, ...] = 1.0
    inertia_scale: float | tuple[float, ...] = 1.0
    payload_kg: float = 0.0
    torque_delay_ticks: int = 0
    stiction_nm: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        """Refuse a plant that cannot be built."""
        if self.torque_delay_ticks not in (0, 1):
            raise InvalidInputError(f"torque_delay_ticks = {self.torque_delay_ticks}; give 0 or 1")
        friction, inertia = np.atleast_1d(self.friction_scale), np.atleast_1d(self.inertia_scale)
        stiction = np.atleast_1d(self.stiction_nm)
        if not ((stiction >= 0) & np.isfinite(stiction)).all():
            raise InvalidInputError(f"stiction_nm = {self.stiction_nm} is no friction; give finite numbers ≥ 0, N m")
        if not (friction >= 0).all() or not (inertia > 0).all() or not math.isfinite(self.payload_kg):
            raise InvalidInputError(
                f"plant (friction × {self.friction_scale}, inertia × {self.inertia_scale}, "
                f"payload {self.payload_kg} kg) cannot exist; "
                "friction_scale must be ≥ 0, inertia_scale > 0, payload_kg finite"
            )


def per_joint(value: float | tuple[float, ...], n: int, name: str) -> np.ndarray:
    """Return one number for each of n joints, (n,).

    Raises:
        InvalidInputError: neither one number nor n.
    """
    numbers = np.atleast_1d(value)
    if numbers.size not in (1, n):
        raise InvalidInputError(f"{name} has {numbers.size} numbers; give one, or one for each of {n} joints")
    return np.broadcast_to(numbers, (n,))


@dataclass(frozen=True)
class SensorConfig:
    """Errors of the sensors; noise is white, given as the standard deviation of each tick.

    Attributes:
        q_rad: joint position.
        qd_rad_s: joint velocity.
        encoder_step_rad: what joint positions are rounded to; 0 for not at all.
        velocity_filter_hz: joint velocity is the measured position's difference quotient behind a first-order low-pass
            of this cut-off (then `qd_rad_s` is not used); inf for the plant's own velocity.
        torque_nm: joint torque, command against what the joint exerts.
        force_n: wrist force sensor, each axis.
        moment_nm: wrist moment, each axis.
        force_bias_n: constant of an episode, standard deviation.
        moment_bias_nm: constant of an episode, standard deviation.
        accelerometer_m_s2: of the sensor's inertial unit, each axis.
        wrist: whether there is a force sensor at the wrist at all.
        velocity_band_rad_s: joint velocity, noise between 5 and 50 Hz beside the above.
        joint_torque: whether the torque behind the gears is measured (`Measurement.torque`).
        joint_torque_nm: its noise, each joint.
        joint_torque_bias_nm: constant of an episode, standard deviation.
        joint_torque_play_nm: half the width of its hysteresis: it follows the torque only so far behind.
    """

    q_rad: float = 1e-5
    qd_rad_s: float = 1e-3
    encoder_step_rad: float = 0.0
    velocity_filter_hz: float = math.inf
    torque_nm: float = 0.05
    force_n: float = 0.1
    moment_nm: float = 0.005
    force_bias_n: float = 0.2
    moment_bias_nm: float = 0.01
    accelerometer_m_s2: float = 0.02
    wrist: bool = True
    velocity_band_rad_s: float = 0.0
    joint_torque: bool = False
    joint_torque_nm: float = 0.0
    joint_torque_bias_nm: float = 0.0
    joint_torque_play_nm: float = 0.0


NO_NOISE = SensorConfig(0.0, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

REAL_SENSORS = SensorConfig(q_rad=0.0, encoder_step_rad=2 * math.pi / 2**19, velocity_filter_hz=100.0)
"""Encoders of 19 bit, velocity from their difference, low-passed; torque and wrist sensor as by default."""

FRANKA_SENSORS = SensorConfig(
    q_rad=0.0, qd_rad_s=0.0, encoder_step_rad=1e-6, velocity_band_rad_s=5e-3, joint_torque=True, joint_torque_nm=0.04,
    joint_torque_bias_nm=0.15, joint_torque_play_nm=0.05,
)  # fmt: skip
"""As a real Panda's recordings show: velocity with 4 to 6 mrad/s of noise between 5 and 50 Hz, and torque sensors."""

SENSORS = {"encoders": REAL_SENSORS, "franka": FRANKA_SENSORS}
"""Sensors of real arms, by name."""


@dataclass(frozen=True)
class WorldConfig:
    """A whole world.

    Attributes:
        plant: how the arm differs from its model.
        sensors: their errors.
        fixtures: what stands about the arm and does not move.
        tip: surface of the tool's tip, for its contacts.
        obstacles: that the arm may meet.
    """

    plant: PlantConfig = field(default_factory=PlantConfig)
    sensors: SensorConfig = field(default_factory=SensorConfig)
    fixtures: tuple[Fixture, ...] = (workbench(),)
    tip: TipSurface = field(default_factory=TipSurface)
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        """Refuse more obstacles or fixtures than a world's record has room for."""
        if len(self.obstacles) > MAX_OBSTACLES:
            raise InvalidInputError(f"{len(self.obstacles)} obstacles asked for; a world holds at most {MAX_OBSTACLES}")
        names = [fixture.name for fixture in self.fixtures]
        if len(names) > MAX_FIXTURES or len(set(names)) < len(names):
            raise InvalidInputError(
                f"fixtures are {', '.join(names)}; give at most {MAX_FIXTURES}, each with a name of its own"
            )
