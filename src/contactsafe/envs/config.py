"""What the wiping task can be told: one frozen dataclass, every field with its unit."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from contactsafe.core.errors import InvalidInputError
from contactsafe.envs.pushes import Pushes
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.drawings import Boards, check_boards
from contactsafe.sim.randomisation import Randomisation

Six = tuple[float, float, float, float, float, float]
Sight = Literal["mask", "photograph"]


@dataclass(frozen=True)
class ActionConfig:
    """How an action in [−1, 1]¹⁸ moves the target, each policy step of 1/60 s.

    Attributes:
        translation: largest step of x_d along x, y, z, m (0.4 m/s along the board, 0.12 m/s towards it).
        rotation: largest step of x_d about x, y, z, rad.
        stiffness: largest step of K1, 1/s²; at K = 100 that is 600 1/s³, within the passive rate of Kronander &
            Billard 2016 (775 1/s³).
        damping: largest step of D1, 1/s.
        lead: largest distance of x_d from the tool along the board, m.
        press: deepest x_d below the board, m.
        height: highest x_d above the board, m.
        reach: half edge of the square around the board's centre that x_d stays in, m.
        tilt: largest rotation of x_d from straight down, rad, each axis.
        stiffness_low, stiffness_high: range of K1, 1/s².
        damping_low, damping_high: range of D1, 1/s.
        stiffness_start: K1 at the start of an episode, 1/s²; D1 starts critical.
    """

    translation: tuple[float, float, float] = (0.0067, 0.0067, 0.002)
    rotation: tuple[float, float, float] = (0.01, 0.01, 0.02)
    stiffness: Six = (10.0, 10.0, 10.0, 20.0, 20.0, 20.0)
    damping: Six = (1.0, 1.0, 1.0, 1.5, 1.5, 1.5)
    lead: float = 0.05
    press: float = 0.012
    height: float = 0.12
    reach: float = 0.27
    tilt: float = 0.06
    stiffness_low: Six = (60.0, 60.0, 60.0, 250.0, 250.0, 250.0)
    stiffness_high: Six = (250.0, 250.0, 250.0, 700.0, 700.0, 700.0)
    damping_low: Six = (14.0, 14.0, 14.0, 30.0, 30.0, 30.0)
    damping_high: Six = (40.0, 40.0, 40.0, 60.0, 60.0, 60.0)
    stiffness_start: Six = (150.0, 150.0, 150.0, 450.0, 450.0, 450.0)


@dataclass(frozen=True)
class RewardConfig:
    """Weights of the reward's terms; each is reported in `info` as `reward_<name>`.

    Attributes:
        ink: for the whole of the ink, paid in shares as it is wiped off.
        done: once, when all is gone.
        approach: per metre by which the nearest ink comes nearer, on steps that wipe nothing.
        contact: per step with the pad on the board under `force_limit_n`.
        time: per step.
        force: per step at twice `gentle_n`, rising from zero at `gentle_n`, at most four times the weight.
        force_limit_n: the paper's 40 N.
        gentle_n: N.
        arm_table: once, when any part but the pad meets board or table; the episode ends.
    """

    ink: float = 10.0
    done: float = 5.0
    approach: float = 5.0
    contact: float = 0.005
    time: float = -0.01
    force: float = -0.04
    force_limit_n: float = 40.0
    gentle_n: float = 7.0
    arm_table: float = -5.0

    def __post_init__(self):
        """Refuse a reward under which staying in contact for ever pays."""
        if self.contact + self.time >= 0:
            raise InvalidInputError(
                f"reward contact {self.contact} + time {self.time} ≥ 0 pays for never finishing; "
                f"keep contact below {-self.time}"
            )


@dataclass(frozen=True)
class WipingConfig:
    """The wiping task.

    Attributes:
        episode_s: time limit, s.
        controller: preset by name; the free-space law is 'vices'.
        clean_fraction: share of the ink below which the board counts as clean.
        start_reach: the tool starts within this of the board's centre along x and y, m.
        start_height: range of the tool's height above the board at the start, m.
        boards: what is drawn on them, 'strokes', 'digits', 'text' or 'handwriting' (lines of either); all but the
            first need `contactsafe[handwriting]`.
        sight: 'mask', the ink as it is, or 'photograph', the ink as segmentation finds it in photographs under light
            that changes with every episode; the latter needs `contactsafe[camera]`.
        pushes: on the arm while it works; None for none.
        randomisation: what differs from episode to episode besides the drawing; None for nothing.
        world: plant, sensors, board, camera, obstacles.
        action: scaling and limits.
        reward: weights.
    """

    episode_s: float = 20.0
    controller: str = "safe"
    clean_fraction: float = 0.002
    start_reach: float = 0.10
    start_height: tuple[float, float] = (0.03, 0.08)
    boards: Boards = "strokes"
    sight: Sight = "mask"
    pushes: Pushes | None = None
    randomisation: Randomisation | None = None
    world: WorldConfig = field(default_factory=WorldConfig)
    action: ActionConfig = field(default_factory=ActionConfig)
    reward: RewardConfig = field(default_factory=RewardConfig)

    def __post_init__(self):
        """Refuse a time limit, a kind of board or of sight that cannot be."""
        check_boards(self.boards)
        if not isinstance(self.episode_s, int | float) or not 1 / 60 <= self.episode_s <= 86400:
            raise InvalidInputError(f"episode_s = {self.episode_s!r}; give seconds, from 1/60 to 86400, a day")
        if self.sight not in get_args(Sight):
            raise InvalidInputError(f"sight = {self.sight!r}; choose mask or photograph")
