"""Pictures of the board of a simulated robot, taken as a camera would: late, noisy, under uneven light."""

from pathlib import Path

import numpy as np

from contactsafe.robot.arm import Arm
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.scene import build_plant
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.photograph import Photographer
from contactsafe.tasks.wiping.robot_board import map_shown

_EVERY_TICKS = 33
"""Thirty pictures a second."""


class PhotographedBoard:
    """A photographer before the board of `WipedBoard`.

    Args:
        path: of what the board shows.
        arm: that stands before it.
        board, camera: as they are.
        seed: of light and noise.
    """

    def __init__(self, path: Path, arm: Arm, board: BoardConfig, camera: Camera, seed: int):
        self._path, self._arm, self._board, self._camera, self._seed = path, arm, board, camera, seed

    def open(self) -> None:
        """Map what the board shows."""
        self._shown = map_shown(self._path, self._board)
        self._photographer = Photographer(self._camera, self._board, build_plant(self._arm, WorldConfig(fixtures=())))
        self._picture, self._number = np.zeros((1, 1, 3), np.uint8), -1

    def latest(self, tick: int) -> tuple[np.ndarray, int, float]:
        """Take a picture where the time for one has come."""
        number = tick // _EVERY_TICKS
        if number != self._number:
            self._number, shown = number, self._shown[0]
            solids = self._photographer.solids_at(shown["q"].copy())
            self._picture = self._photographer.take(shown["cells"], solids, self._seed, number)
        return self._picture, number, float(tick - number * _EVERY_TICKS)

    def close(self) -> None:
        """Nothing is to be let go of."""
