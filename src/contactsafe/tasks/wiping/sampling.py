"""Masks to learn to see from: boards from full to nearly clean, the arm in and out of view."""

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.policy.action import DOWN
from contactsafe.robot.arm import Pose
from contactsafe.tasks.wiping.camera import render_mask
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.drawings import paint_board
from contactsafe.tasks.wiping.tasks import WipingTasks
from contactsafe.tasks.wiping.whiteboard import INK, erase_under_pad

_RAISED = 0.35  # m above the board: the arm is out of the camera's view of it
_FRACTION_RAISED = 0.1
_FRACTION_BLANK = 0.2  # of the boards that were wiped clean: the rest are painted anew


class MaskSampler(Independent):
    """Sample masks such as a wiping episode shows, without running one.

    Args:
        config: of the task.

    Attributes:
        homography: of board plane to mask pixels, (3, 3).
    """

    def __init__(self, config: WipingConfig | None = None):
        self._tasks = WipingTasks(config)
        self.homography = self._tasks.boards.homography

    def sample(self, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Sample masks.

        Args:
            n: how many.
            seed: the same seed gives the same masks.

        Returns:
            Masks, uint8 (n, size, size); tool positions, (n, 3), m.
        """
        rng = np.random.default_rng(seed)
        size = self._tasks.config.camera.size
        masks, tools = np.empty((n, size, size), np.uint8), np.empty((n, 3))
        for k in range(n):
            tools[k] = self._draw(rng, masks[k])
        return masks, tools

    def _draw(self, rng: np.random.Generator, mask: np.ndarray) -> np.ndarray:
        worlds, boards = self._tasks.worlds, self._tasks.boards
        board = boards.boards[0]
        self._paint_board(rng)
        tool = self._place_tool(rng)
        if rng.uniform() < 0.5 and tool[2] < board.config.centre[2] + 0.02:
            self._erase(tool)
        render_mask(boards.camera, boards.cells[0], worlds.records[0]["plant"], mask)
        return tool

    def _paint_board(self, rng: np.random.Generator) -> None:
        """Paint and wipe until there is something to see, mostly."""
        board = self._tasks.boards.boards[0]
        while True:
            board.clear()
            paint_board(board, self._tasks.config.boards, rng)
            self._wipe(rng, left=rng.uniform())
            if board.ink_cells > 0 or rng.uniform() < _FRACTION_BLANK:
                return

    def _place_tool(self, rng: np.random.Generator) -> np.ndarray:
        tasks = self._tasks
        board = tasks.config.board
        reach = board.ink_size / 2 + 0.05
        height = _RAISED if rng.uniform() < _FRACTION_RAISED else 0.08 * rng.uniform() ** 2
        tool = np.add(board.centre, [*rng.uniform(-reach, reach, 2), height])
        tasks.worlds.place(0, tasks.posture_over(Pose(tool, DOWN)))
        return tool

    def _wipe(self, rng: np.random.Generator, left: float) -> None:
        """Put the pad down on ink, at random, until this fraction of the ink is left."""
        cells, board = self._tasks.boards.cells[0], self._tasks.boards.boards[0]
        start = board.ink_cells
        while board.ink_cells > left * start:
            ink = np.argwhere(cells == INK)
            spot = board.origin + (ink[rng.integers(len(ink))] + rng.uniform(-15, 15, 2)) * board.config.cell
            self._erase(np.array([*spot, 0.0]))

    def _erase(self, position: np.ndarray) -> None:
        record = self._tasks.boards.records[0]
        (x, y), (half_x, half_y) = record["origin"], record["pad_half"]
        erase_under_pad(
            self._tasks.boards.cells[0], x, y, record["cell"], position, np.diag([1.0, -1.0, -1.0]), half_x, half_y
        )
