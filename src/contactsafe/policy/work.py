"""What a task supplies so that a policy does it on a real robot."""

from typing import Protocol

import numpy as np

from contactsafe.policy.action_config import ActionConfig
from contactsafe.robot.arm import Arm, Pose


class Work(Protocol):
    """What a task supplies for a real robot; made in the command, used in the policy's process."""

    @property
    def start(self) -> Pose:
        """Where the tool waits before the policy begins, and when it is done."""
        ...

    @property
    def centre(self) -> tuple[float, float, float]:
        """Point that the bounds of the target are about, world, m."""
        ...

    @property
    def action(self) -> ActionConfig:
        """How actions move the target."""
        ...

    @property
    def travel_m_s(self) -> float:
        """Speed of the target as it goes to the start, m/s."""
        ...

    @property
    def homography(self) -> np.ndarray | None:
        """Of the camera that makes the masks; None where there is none."""
        ...

    def prepare(self, arm: Arm, lockstep: bool, speed: float = 1.0) -> None:
        """Open what it looks with; in the policy's process.

        Args:
            arm: that works.
            lockstep: pictures are taken as control counts ticks.
            speed: factor on how fast the target moves, at most 1: all takes longer by it.
        """
        ...

    def look(self, seen: np.void, pose: np.ndarray, steps: int) -> dict[str, np.ndarray]:
        """Return what the policy observes beside pose and target; `steps` counts from its beginning, −1 before it."""
        ...

    def is_blind(self) -> bool:
        """Tell whether what it looks with shows what is past."""
        ...

    def is_ready(self) -> bool:
        """Tell whether there is work to begin."""
        ...

    def is_done(self) -> bool:
        """Tell whether the work that was begun is done."""
        ...

    def is_stalled(self) -> bool:
        """Tell whether the work that was begun gets nowhere, and is better begun anew from the start."""
        ...

    def seen_with(self) -> tuple[float, int]:
        """Return the age of the last picture, ms, and how many of its mask's pixels show something; NaN and 0."""
        ...

    def close(self) -> None:
        """Let go of what it looks with."""
        ...
