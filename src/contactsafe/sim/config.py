"""What a simulated world can be told: plant, sensors, board, camera, obstacles; frozen dataclasses with units."""

import math
from dataclasses import dataclass, field

import numpy as np

from contactsafe.core.errors import InvalidInputError

Vector3 = tuple[float, float, float]

MAX_OBSTACLES = 4
"""Most obstacles one world holds."""


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
    """

    friction_scale: float | tuple[float, ...] = 1.0
    inertia_scale: float | tuple[float, ...] = 1.0
    payload_kg: float = 0.0
    torque_delay_ticks: int = 0

    def __post_init__(self):
        """Refuse a plant that cannot be built."""
        if self.torque_delay_ticks not in (0, 1):
            raise InvalidInputError(f"torque_delay_ticks = {self.torque_delay_ticks}; give 0 or 1")
        friction, inertia = np.atleast_1d(self.friction_scale), np.atleast_1d(self.inertia_scale)
        if not (friction >= 0).all() or not (inertia > 0).all() or not math.isfinite(self.payload_kg):
            raise InvalidInputError(
                f"plant (friction × {self.friction_scale}, inertia × {self.inertia_scale}, "
                f"payload {self.payload_kg} kg) cannot exist; "
                "friction_scale must be ≥ 0, inertia_scale > 0, payload_kg finite"
            )


def per_joint(value: float | tuple[float, ...], n: int, name: str) -> np.ndarray:
    """Give one number for each of n joints, (n,).

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


NO_NOISE = SensorConfig(0.0, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

REAL_SENSORS = SensorConfig(q_rad=0.0, encoder_step_rad=2 * math.pi / 2**19, velocity_filter_hz=100.0)
"""Encoders of 19 bit, velocity from their difference, low-passed; torque and wrist sensor as by default."""


@dataclass(frozen=True)
class BoardConfig:
    """The whiteboard on the table before the arm.

    Attributes:
        centre: of its upper face, world, m.
        size: along x and y, m.
        ink_size: edge of the square in its middle that may be drawn on, m.
        cell: edge of one ink cell, m.
        friction: Coulomb coefficient of pad on board.
        press_n: force with which the pad must be pressed to erase, N.
    """

    centre: Vector3 = (0.5, 0.0, 0.01)
    size: tuple[float, float] = (0.5, 0.6)
    ink_size: float = 0.3
    cell: float = 0.002
    friction: float = 0.3
    press_n: float = 0.5


@dataclass(frozen=True)
class Camera:
    """A pinhole camera on a stand, looking at the board at an angle.

    The defaults are a RealSense D455's colour image (1280 × 720, 640 px focal length by data sheet FOV 90° × 65°),
    cropped to the 455 px square around the board and scaled to 128.

    Attributes:
        position: world, m.
        target: point in the middle of the image, world, m.
        focal_px: focal length in pixels of the 128 × 128 image.
        size: pixels along an edge.
    """

    position: Vector3 = (1.05, 0.0, 0.65)
    target: Vector3 = (0.5, 0.0, 0.01)
    focal_px: float = 180.0
    size: int = 128


@dataclass(frozen=True)
class Obstacle:
    """A thing that the arm may meet, held by springs along x, y and z, or fixed; its hold may move towards the arm.

    Attributes:
        position: of its centre at rest, world, m.
        radius: m.
        stiffness: of each spring, N/m; inf for a thing that cannot move.
        mass: kg.
        damping_ratio: of spring and mass.
        half_length: of a standing cylinder, m; 0 for a sphere.
        surface_s: time constant of MuJoCo's contact, s: the larger, the softer its surface (0.02 is MuJoCo's default).
        travel: way that its hold moves, world, m.
        travel_s: when it sets off and when it arrives, s since reset.
        travel_until_n: its hold stops for good once it presses this hard on the arm, N; inf to go all the way.
    """

    position: Vector3
    radius: float
    stiffness: float
    mass: float = 1.0
    damping_ratio: float = 0.2
    half_length: float = 0.0
    surface_s: float = 0.004
    travel: Vector3 = (0.0, 0.0, 0.0)
    travel_s: tuple[float, float] = (0.0, 1.0)
    travel_until_n: float = math.inf

    @property
    def fixed(self) -> bool:
        """Whether it cannot move."""
        return math.isinf(self.stiffness)

    def __post_init__(self):
        """Refuse what MuJoCo would hardly feel (its contact stiffness scales with mass) or cannot build."""
        if self.mass < 0.1:
            raise InvalidInputError(
                f"obstacle mass = {self.mass} kg; give 0.1 kg or more, lighter ones hardly push back"
            )
        if self.radius <= 0 or self.stiffness <= 0:
            raise InvalidInputError(
                f"obstacle radius = {self.radius} m, stiffness = {self.stiffness} N/m; both must be greater than 0"
            )
        if not self.travel_until_n > 0:
            raise InvalidInputError(f"obstacle travel_until_n = {self.travel_until_n} N; give a force above 0, or inf")
        if any(self.travel) and (self.fixed or not self.travel_s[0] < self.travel_s[1]):
            raise InvalidInputError(
                f"obstacle travels {self.travel} m in {self.travel_s} s with stiffness {self.stiffness} N/m; "
                "give a finite stiffness, and a time of arrival after that of departure"
            )


def bottle(position: Vector3) -> Obstacle:
    """Give a plastic water bottle held in a hand: 2 kN/m."""
    return Obstacle(position, radius=0.035, stiffness=2000.0, mass=0.5, half_length=0.09)


def thrust_meter(position: Vector3) -> Obstacle:
    """Give a hand-held force gauge: 20 kN/m."""
    return Obstacle(position, radius=0.02, stiffness=20000.0, mass=1.0)


@dataclass(frozen=True)
class WorldConfig:
    """A whole world.

    Attributes:
        plant: how the arm differs from its model.
        sensors: noise.
        board: the whiteboard.
        camera: what looks at it.
        obstacles: things in the way.
    """

    plant: PlantConfig = field(default_factory=PlantConfig)
    sensors: SensorConfig = field(default_factory=SensorConfig)
    board: BoardConfig = field(default_factory=BoardConfig)
    camera: Camera = field(default_factory=Camera)
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self):
        """Refuse more obstacles than a world's record has room for."""
        if len(self.obstacles) > MAX_OBSTACLES:
            raise InvalidInputError(f"{len(self.obstacles)} obstacles asked for; a world holds at most {MAX_OBSTACLES}")
