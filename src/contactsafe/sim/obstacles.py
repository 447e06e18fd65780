"""Things that an arm may meet: held by springs or fixed, at rest or moving towards the arm."""

import math
from dataclasses import dataclass

from contactsafe.core.errors import InvalidInputError

Vector3 = tuple[float, float, float]

MAX_OBSTACLES = 4
"""Most obstacles one world holds."""


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
        travel: displacement of its hold, world, m.
        travel_s: when it sets off and when it arrives, s since reset.
        travel_until_n: force on the arm at which its hold stops for good, N; inf for never.
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

    def __post_init__(self) -> None:
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
    """Return a plastic water bottle held in a hand: 2 kN/m."""
    return Obstacle(position, radius=0.035, stiffness=2000.0, mass=0.5, half_length=0.09)


def thrust_meter(position: Vector3) -> Obstacle:
    """Return a hand-held force gauge: 20 kN/m."""
    return Obstacle(position, radius=0.02, stiffness=20000.0, mass=1.0)
