"""How far one action moves a target, and the bounds that it keeps."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.policy.action_checks import check_bounds, check_steps

ACTIONS = tuple(
    f"{group}_{axis}"
    for group in ("x_d", "K_task", "D_task")
    for axis in ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
)
"""What each number of an action increments, in order; each in [-1, 1]."""

ACTION_SIZE = len(ACTIONS)

LEARNED_GAINS = "learned"

GAINS = (LEARNED_GAINS, "low", "middle", "high")
"""Who sets K1 and D1: the policy, or nobody: K1 stays at the low end, in the middle or at the high end of its range."""

Six = tuple[float, float, float, float, float, float]


def learned_actions(gains: str) -> int:
    """Return how many of the actions have an effect, from the first on: with constant gains those that move x_d."""
    return ACTION_SIZE if gains == LEARNED_GAINS else 6


@dataclass(frozen=True)
class ActionConfig:
    """How an action in [−1, 1]¹⁸ moves the target, each policy step of 1/60 s.

    Attributes:
        translation: largest step of x_d along x, y, z, m (0.4 m/s along x and y, 0.12 m/s along z).
        rotation: largest step of x_d about x, y, z, rad.
        stiffness: largest step of K1, 1/s²; at K = 100 that is 600 1/s³, within the passive rate of Kronander &
            Billard 2016 (775 1/s³).
        damping: largest step of D1, 1/s.
        offset_max: largest distance of x_d from the tool along x and y, m.
        offset_max_z: the same along z, m: what the spring stores against a surface comes free where that ends; inf for
            no bound.
        press: lowest x_d below the centre of the workspace, m.
        height: highest x_d above it, m.
        reach: half edge of the square around it that x_d stays in, m.
        tilt: largest rotation of x_d from straight down, rad, each axis.
        stiffness_low, stiffness_high: range of K1, 1/s².
        damping_low, damping_high: range of D1, 1/s.
        stiffness_start: K1 at the start of an episode, 1/s²; D1 starts critical.
        gains: one of `GAINS`; where not learned, the last twelve actions do nothing, K1 is constant, and D1 is as near
            to critical damping as its range allows.
    """

    translation: tuple[float, float, float] = (0.0067, 0.0067, 0.002)
    rotation: tuple[float, float, float] = (0.01, 0.01, 0.02)
    stiffness: Six = (10.0, 10.0, 10.0, 20.0, 20.0, 20.0)
    damping: Six = (1.0, 1.0, 1.0, 1.5, 1.5, 1.5)
    offset_max: float = 0.05
    offset_max_z: float = math.inf
    press: float = 0.012
    height: float = 0.12
    reach: float = 0.27
    tilt: float = 0.06
    stiffness_low: Six = (60.0, 60.0, 60.0, 250.0, 250.0, 250.0)
    stiffness_high: Six = (250.0, 250.0, 250.0, 700.0, 700.0, 700.0)
    damping_low: Six = (14.0, 14.0, 14.0, 30.0, 30.0, 30.0)
    damping_high: Six = (40.0, 40.0, 40.0, 60.0, 60.0, 60.0)
    stiffness_start: Six = (150.0, 150.0, 150.0, 450.0, 450.0, 450.0)
    gains: str = LEARNED_GAINS

    def __post_init__(self) -> None:
        """Refuse gains that are unknown, and steps and bounds that cannot be."""
        if self.gains not in GAINS:
            raise InvalidInputError(f"gains = {shown(self.gains)}; choose from {', '.join(GAINS)}")
        check_steps(self)
        check_bounds(self)

    @property
    def stiffness_range(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest K1 that an episode sees, (6,) each, 1/s²; the same where gains are constant."""
        low, high = np.array(self.stiffness_low), np.array(self.stiffness_high)
        constant = {"low": low, "middle": (low + high) / 2.0, "high": high}.get(self.gains)
        return (low, high) if constant is None else (constant, constant)

    @property
    def stiffness_first(self) -> np.ndarray:
        """K1 at the start of an episode, (6,), 1/s²: `stiffness_start`, or where it always is."""
        return np.array(self.stiffness_start) if self.gains == LEARNED_GAINS else self.stiffness_range[0]


class ActionLimits(NamedTuple):
    """An `ActionConfig` as arrays for compiled code.

    Attributes:
        step: largest change of pose, K1, D1, (18,).
        low, high: bounds of x_d along x, y, z, m, and of the rotation vector from straight down, rad, (6,).
        K_low, K_high, D_low, D_high: (6,).
        offset_max: along x, y, z, (3,), m.
    """

    step: np.ndarray
    low: np.ndarray
    high: np.ndarray
    K_low: np.ndarray
    K_high: np.ndarray
    D_low: np.ndarray
    D_high: np.ndarray
    offset_max: np.ndarray


def action_limits(config: ActionConfig, centre: tuple[float, float, float]) -> ActionLimits:
    """Resolve an action configuration for a workspace around a point, world, m."""
    x, y, z = centre
    reach, tilt = config.reach, config.tilt
    K_low, K_high = config.stiffness_range
    D_low, D_high = np.array(config.damping_low), np.array(config.damping_high)
    if config.gains != LEARNED_GAINS:
        D_low = D_high = np.clip(2.0 * np.sqrt(K_low), D_low, D_high)
    return ActionLimits(
        step=np.array([*config.translation, *config.rotation, *config.stiffness, *config.damping]),
        low=np.array([x - reach, y - reach, z - config.press, -tilt, -tilt, -tilt]),
        high=np.array([x + reach, y + reach, z + config.height, tilt, tilt, tilt]),
        K_low=K_low,
        K_high=K_high,
        D_low=D_low,
        D_high=D_high,
        offset_max=np.array([config.offset_max, config.offset_max, config.offset_max_z]),
    )
