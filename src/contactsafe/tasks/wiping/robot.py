"""Wiping on a Franka, and on a simulated one before a whiteboard whose ink vanishes."""

from pathlib import Path
from typing import Any

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm
from contactsafe.robot.franka import WIPER
from contactsafe.sim.fixtures import TipSurface, workbench
from contactsafe.sim.franka_meetings import WORK_BEGINS_S
from contactsafe.sim.franka_scene import FrankaScene
from contactsafe.tasks.base.robot import Simulated, met_by
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.placed_camera import PlacedCamera
from contactsafe.tasks.wiping.robot_board import WipedBoard, create_shown, map_shown
from contactsafe.tasks.wiping.robot_photographs import PhotographedBoard
from contactsafe.tasks.wiping.robot_pictures import CameraPictures
from contactsafe.tasks.wiping.robot_work import WipingWork


def _placed(looks: dict[str, Any]) -> PlacedCamera | None:
    """Return camera and board where a calibration among what a task looks with says, None where there is none."""
    calibration, config = looks.get("camera_calibration"), WipingConfig()
    return None if calibration is None else PlacedCamera(calibration, config.board, config.camera)


class WipingRobot:
    """The wiping task for a real robot."""

    tool = WIPER

    def work(self, **looks: Any) -> WipingWork:
        """Return the work, with the pictures that it looks at, or those of the camera of a serial number.

        Raises:
            InvalidInputError: the calibration is of another camera, or of a place where the task cannot be done.
        """
        config, placed = WipingConfig(), _placed(looks)
        serial = looks.get("camera") or (placed and placed.calibration.serial) or None
        if placed is not None and serial and placed.calibration.serial not in ("", serial):
            raise InvalidInputError(
                f"camera {serial} is not the one that was calibrated, {placed.calibration.serial}; calibrate it, or "
                "leave --camera out"
            )
        pictures = looks.get("pictures") or CameraPictures(serial, config.camera, placed)
        return WipingWork(pictures, config.board, config.camera, config.action, placed)

    def simulated(self, arm: Arm, shared: Path, seed: int, rounds: int, met: bool, **looks: Any) -> Simulated:
        """Return a run before boards of random strokes, seen in photographs; where a calibration says, if any."""
        config, path = WipingConfig(), shared.with_name(f"{shared.name}-board")
        placed, tip = _placed(looks), self.tool.tip
        board = config.board if placed is None else placed.board
        assert tip is not None
        work = self.work(pictures=PhotographedBoard(path, arm, board, config.camera, seed, placed), **looks)
        create_shown(path, board)
        effect = WipedBoard(path, board, tip.half_size, "strokes", seed, rounds, first_s=WORK_BEGINS_S if met else 0.0)
        scene = FrankaScene(self.tool, TipSurface(friction=board.friction), (workbench(board.centre, board.size),))
        shown = map_shown(path, board)

        def figures(truth: np.ndarray) -> dict[str, float]:
            del truth
            started, left = shown["ink_start"][0][:rounds], shown["ink"][0][:rounds]
            drawn = started > 0
            gone = 1.0 - left[drawn] / started[drawn]
            done = {f"done, ink gone from board {k + 1}": float(x) for k, x in enumerate(gone)}
            return {"boards drawn on": float(drawn.sum()), **done}

        return Simulated(met_by(scene, arm) if met else scene, effect, work, figures, path.unlink)
