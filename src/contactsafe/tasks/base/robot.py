"""What a task supplies to be run on a real robot, and on a simulated one over the robot's own network protocol."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from contactsafe.policy.work import Work
from contactsafe.robot.arm import Arm
from contactsafe.robot.description import Tool
from contactsafe.sim.franka_meetings import bottle_in_the_way, pushes
from contactsafe.sim.franka_scene import FrankaScene
from contactsafe.sim.franka_server import Effect


@dataclass(frozen=True)
class Simulated:
    """A run on a simulated robot.

    Attributes:
        scene: about the robot.
        effect: of the tool on it.
        work: of the policy.
        figures: what was achieved, by name, after the run, of what really happened, `truth_dtype` records; names that
            begin with "done" are fractions of the work.
        close: removes what it left.
    """

    scene: FrankaScene
    effect: Effect | None
    work: Work
    figures: Callable[[np.ndarray], dict[str, float]] = lambda truth: {}
    close: Callable[[], None] = lambda: None


class RobotTask(Protocol):
    """A task that a real robot can do."""

    tool: Tool

    def work(self, **looks: Any) -> Work:
        """Return the work on a real robot.

        Args:
            looks: what it looks with: `camera`, a serial number; `camera_calibration`, what `contactsafe calibrate`
                wrote. A task without a camera refuses the latter.
        """
        ...

    def simulated(self, arm: Arm, shared: Path, seed: int, rounds: int, met: bool, **looks: Any) -> Simulated:
        """Return a run on a simulated one.

        Args:
            arm: that works.
            shared: beginning of the names of shared memory that it may make.
            seed: of what is drawn at random.
            rounds: of work.
            met: a person pushes the arm and holds a bottle against it.
            looks: as of `work`.
        """
        ...


def met_by(scene: FrankaScene, arm: Arm) -> FrankaScene:
    """Return a scene with a bottle in the wrist's path from home, and a person who pushes the arm."""
    return replace(scene, pushes=pushes(), obstacles=(bottle_in_the_way(arm),))
