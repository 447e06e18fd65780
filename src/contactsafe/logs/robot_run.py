"""Logs of `contactsafe run`: read like any log, and played to the control tick once more, torque by torque."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from contactsafe.control import presets
from contactsafe.control.controller import Controller
from contactsafe.control.tick import tick_at
from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware.control_loop import for_robot
from contactsafe.hardware.messages import row_dtype
from contactsafe.hardware.run_log import is_run, read_run
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm
from contactsafe.tasks import task_by_name

_JOINTS = 7


def run_arrays(path: Path) -> dict[str, np.ndarray] | None:
    """Return what a recorded run has of the joints, each name an array with a row a tick; None where it is none."""
    if not is_run(path):
        return None
    _, rows = read_run(path, row_dtype(_JOINTS))
    reading = rows["reading"][rows["tick"] > 0]
    first = np.concatenate([[True], np.diff(reading["time"]) > 0.0])
    names = {"time": "time", "q": "q", "qd": "qd", "torque": "torque"}
    return {name: reading[field][first].copy() for name, field in names.items()}


@dataclass(frozen=True)
class TorquesAgain:
    """A run's torques, computed again.

    Attributes:
        ticks: compared.
        same: that have the same torque, bit by bit.
        largest_nm: largest difference.
        first: number of the first tick that differs, 0 for none.
    """

    ticks: int
    same: int
    largest_nm: float
    first: int

    @property
    def verdict(self) -> str:
        """All in one line."""
        if self.same == self.ticks:
            return f"all {self.ticks} torques are the same, bit by bit"
        return (
            f"{self.ticks - self.same} of {self.ticks} torques differ, by {self.largest_nm:.3g} N m at most, the first "
            f"at tick {self.first}"
        )


def torques_again(path: Path) -> TorquesAgain:
    """Run what was recorded through the control tick, from the same beginning.

    Args:
        path: of a run's log.

    Raises:
        InvalidInputError: it is none, or from a robot, task or controller that is unknown here.
    """
    run, rows = read_run(path, row_dtype(_JOINTS))
    if len(rows) < 2 or rows["tick"][0] != 0:
        raise InvalidInputError(f"{path} does not begin with the run's first tick; give a whole log")
    controller = Controller(_arm_of(run), for_robot(presets.by_name(run.get("controller", "safe"))))
    q = rows["measurement"]["q"][0].copy()
    controller.reset(q, np.zeros(_JOINTS))
    controller.record["target"] = rows["target"][0]
    found = np.array([_torque(controller, row) for row in rows[1:]])
    recorded = rows["output"]["torque"][1:]
    same = (found.view(np.int64) == recorded.copy().view(np.int64)).all(axis=1)
    first = 0 if same.all() else int(rows["tick"][1:][np.argmin(same)])
    return TorquesAgain(len(same), int(same.sum()), float(np.abs(found - recorded).max(initial=0.0)), first)


def _torque(controller: Controller, row: np.void) -> np.ndarray:
    """Run one tick on what was recorded of it; return its torque, (n,), N m."""
    record = controller.record
    record["measurement"], record["target"] = row["measurement"], row["target"]
    tick_at(controller._ticked, controller._index)
    return record["output"]["torque"].copy()


_ROBOTS: dict[str, Callable[..., Arm]] = {"fr3": robots.fr3, "panda": robots.panda}


def _arm_of(run: dict[str, str]) -> Arm:
    robot, task = run.get("robot", ""), run.get("task", "")
    if robot not in _ROBOTS:
        raise InvalidInputError(f"the log is of robot {robot!r}; known are {', '.join(_ROBOTS)}")
    described = task_by_name(task)
    if described.robot is None:
        raise InvalidInputError(f"the log is of task {task!r}, which says nothing of real robots")
    arm = _ROBOTS[robot](described.robot().tool)
    calibration = run.get("calibration")
    return robots.calibrated(arm, Path(calibration)) if calibration else arm
