"""What the insertion task can be told."""

import math
from dataclasses import dataclass, field

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.action_config import ActionConfig
from contactsafe.sim.fixtures import Vector3
from contactsafe.tasks.base.config import TaskConfig

ACTION = ActionConfig(
    translation=(0.0005, 0.0005, 0.0003),
    rotation=(0.0025, 0.0025, 0.0025),
    offset_max=0.008,
    offset_max_z=0.006,
    damping_low=(32.0, 32.0, 32.0, 40.0, 40.0, 40.0),
    damping_high=(50.0, 50.0, 50.0, 60.0, 60.0, 60.0),
    press=0.06,
    height=0.03,
    reach=0.02,
    tilt=0.08,
)
"""At most 30 mm/s sideways, 18 mm/s down, and 0.15 rad/s about each axis."""


MAX_START_M = 0.2
"""Greatest height of the tip above the believed mouth at the start, m."""


@dataclass(frozen=True)
class InsertionReward:
    """Weights of the reward's terms; each is reported in `info` as `reward_<name>`.

    Attributes:
        approach: per metre by which the tip comes nearer to the true mouth, sideways and down together.
        depth: per metre by which it goes deeper.
        done: once, when it is in.
        time: per step.
        force: per step at twice `gentle_n`, rising from zero at `gentle_n`, at most four times the weight.
        gentle_n: N.
        arm_touched: once, when any part but the peg meets table or block; the episode ends.
    """

    approach: float = 100.0
    depth: float = 400.0
    done: float = 5.0
    time: float = -0.005
    force: float = -0.03
    gentle_n: float = 15.0
    arm_touched: float = -5.0


@dataclass(frozen=True)
class InsertionConfig(TaskConfig):
    """A round peg and a hole in a block.

    Attributes:
        clearance_m: radial, between peg and hole, m.
        depth_m: at which the peg counts as inserted, m.
        error_m: the hole is within this of where it is believed to be, along x and along y, m.
        tilt_rad: its axis is tilted by up to this about x and about y, rad.
        friction: range of the coefficient of peg on block.
        start_m: range of the tip's height above the believed mouth at the start, m.
        mouth: where the hole's mouth is believed to be, world, m.
        reward: weights.
    """

    episode_s: float = 10.0
    action: ActionConfig = ACTION
    clearance_m: float = 0.0005
    depth_m: float = 0.025
    error_m: float = 0.005
    tilt_rad: float = 0.035
    friction: tuple[float, float] = (0.1, 0.5)
    start_m: tuple[float, float] = (0.005, 0.015)
    mouth: Vector3 = (0.5, 0.0, 0.05)
    reward: InsertionReward = field(default_factory=InsertionReward)

    def __post_init__(self) -> None:
        """Refuse holes that are none."""
        super().__post_init__()
        if not 1e-5 <= self.clearance_m <= 0.005:
            raise InvalidInputError(f"clearance_m = {self.clearance_m}; give 0.00001 to 0.005 m, between the radii")
        if not 0.0 < self.depth_m <= 0.03:
            raise InvalidInputError(f"depth_m = {self.depth_m}; give more than 0 and at most 0.03 m")
        if not (0.0 <= self.error_m <= 0.02 and 0.0 <= self.tilt_rad <= 0.2):
            raise InvalidInputError(
                f"error_m = {self.error_m}, tilt_rad = {self.tilt_rad}; give at most 0.02 m and 0.2 rad, none negative"
            )
        low, high = self.start_m
        if not 0.0 <= low <= high <= MAX_START_M:
            raise InvalidInputError(f"start_m = {self.start_m}; give (low, high) with 0 ≤ low ≤ high ≤ {MAX_START_M} m")
        low, high = self.friction
        if not 0.0 <= low <= high <= 2.0:
            raise InvalidInputError(f"friction = {self.friction}; give (low, high) with 0 ≤ low ≤ high ≤ 2")
        if not (len(self.mouth) == 3 and all(map(math.isfinite, self.mouth))):
            raise InvalidInputError(f"mouth = {self.mouth}; give three finite numbers x, y, z, m")
