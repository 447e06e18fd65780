"""What the wiping task can be told: one frozen dataclass, every field with its unit."""

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.base.config import TaskConfig
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.drawings import Boards, check_boards
from contactsafe.tasks.wiping.randomisation import Randomisation

ImageSource = Literal["mask", "photograph"]


@dataclass(frozen=True)
class RewardConfig:
    """Weights of the reward's terms; each is reported in `info` as `reward_<name>`.

    Attributes:
        ink: for the whole of the ink, paid in proportion as it is wiped off.
        done: once, when all is gone.
        approach: per metre by which the nearest ink comes nearer, on steps that wipe nothing.
        nearness: per step on ink, falling linearly to nothing at `nearness_m` from it; reported with `approach`.
        contact: per step with the pad on the board under `force_limit_n`.
        time: per step.
        force: per step at twice `gentle_n`, rising from zero at `gentle_n`, at most four times the weight.
        force_limit_n: the paper's 40 N.
        gentle_n: N.
        nearness_m: m.
        arm_table: once, when any part but the pad meets board or table; the episode ends.
        staying_pays: accept a reward that goes on while nothing is done.
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
    nearness: float = 0.0
    nearness_m: float = 0.3
    staying_pays: bool = False

    def __post_init__(self) -> None:
        """Refuse a reward under which staying in contact for ever pays, unless that is asked for."""
        staying = self.contact + self.nearness
        if staying + self.time >= 0 and not self.staying_pays:
            raise InvalidInputError(
                f"reward contact {staying} + time {self.time} ≥ 0 pays for never finishing; "
                f"keep contact below {-self.time}"
            )
        if not self.nearness_m > 0.0:
            raise InvalidInputError(f"reward nearness_m = {self.nearness_m}; give more than 0 m")

    @classmethod
    def as_paper(cls) -> "RewardConfig":
        """Return the reward in the paper's words (section IV-A), which leave its weights open.

        Something for ink, something for the last of it, "a small reward if the agent keeps contacting the table and the
        contact force is less than 40 N", "a small reward increasing as the distance [...] decreases" and "a large
        penalty" for the arm on the table; nothing for time or force. Staying pays 0.01 a step at most, which a discount
        of 0.995 makes 2 for ever: less than the 5 for the end.
        """
        return cls(approach=0.0, nearness=0.005, time=0.0, force=0.0, staying_pays=True)


@dataclass(frozen=True)
class WipingConfig(TaskConfig):
    """The wiping task; the world's fixtures and the tip's surface are the board's.

    Attributes:
        clean_fraction: fraction of the ink below which the board counts as clean.
        start_reach: the tool starts within this of the board's centre along x and y, m.
        start_height: range of the tool's height above the board at the start, m.
        boards: what is drawn on them, 'strokes', 'digits', 'text' or 'handwriting' (lines of either); all but the
            first need `contactsafe[handwriting]`.
        image_source: 'mask', the ink as it is, or 'photograph', the ink as segmentation finds it in photographs under
            light that changes with every episode; the latter needs `contactsafe[camera]`.
        randomisation: what differs from episode to episode besides the drawing; None for nothing.
        board: the whiteboard.
        camera: what looks at it.
        reward: weights.
    """

    clean_fraction: float = 0.002
    start_reach: float = 0.10
    start_height: tuple[float, float] = (0.03, 0.08)
    boards: Boards = "strokes"
    image_source: ImageSource = "mask"
    randomisation: Randomisation | None = None
    board: BoardConfig = field(default_factory=BoardConfig)
    camera: Camera = field(default_factory=Camera)
    reward: RewardConfig = field(default_factory=RewardConfig)

    def __post_init__(self) -> None:
        """Refuse a start, a kind of board or an image source that cannot be."""
        super().__post_init__()
        check_boards(self.boards)
        if not 0.0 <= self.clean_fraction < 1.0:
            raise InvalidInputError(f"clean_fraction = {self.clean_fraction}; give at least 0 and less than 1")
        low, high = self.start_height
        if not (0.0 <= low <= high < math.inf and 0.0 <= self.start_reach < math.inf):
            raise InvalidInputError(
                f"start_reach = {self.start_reach}, start_height = {self.start_height}; give a reach of 0 m or more, "
                "and (low, high) with 0 ≤ low ≤ high"
            )
        if self.image_source not in get_args(ImageSource):
            raise InvalidInputError(f"image_source = {self.image_source!r}; choose mask or photograph")
