"""A whiteboard under a simulated robot: its ink vanishes under the pad, and a person draws on it anew once it is clean.

The board lies in a file of shared memory, which whoever photographs it maps as well.
"""

import mmap
import os
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from contactsafe.hardware.realsense import HEIGHT, WIDTH
from contactsafe.tasks.wiping.board import BoardConfig
from contactsafe.tasks.wiping.drawings import Boards, paint_board
from contactsafe.tasks.wiping.whiteboard import INK, Whiteboard, erase_under_pad

_ERASE_EVERY = 8  # ticks
_AWAY_M, _AWAY_TICKS, _LEFT_TICKS = 0.04, 500, 10_000
"""A clean board is drawn on once the tool has been this far above it for so long; one that is not, for ten seconds:
the robot has taken it for clean."""

_MOST = 64  # boards of a run


def shown_dtype(board: BoardConfig) -> np.dtype:
    """Describe what a board shows: its cells, where the arm before it is, and what a camera saw last."""
    return np.dtype(
        [
            ("number", np.int64),  # of the board, from 0
            ("tick", np.int64),
            ("q", float, (7,)),
            ("ink_start", np.int64, (_MOST,)),  # cells when it was drawn
            ("ink", np.int64, (_MOST,)),  # cells left
            ("cells", np.uint8, Whiteboard(board).cells.shape),
            ("taken", np.int64, (2,)),  # number of the last two pictures of it, from 1; 0 while one is being drawn
            ("taken_tick", np.int64, (2,)),  # when they were taken
            ("pictures", np.uint8, (2, HEIGHT, WIDTH, 3)),  # they alternate
        ]
    )


def map_shown(path: Path, board: BoardConfig) -> np.ndarray:
    """Map what a board shows, one record; the file exists and is large enough."""
    with open(path, "r+b") as file:
        return np.frombuffer(mmap.mmap(file.fileno(), 0), shown_dtype(board), 1)


def create_shown(path: Path, board: BoardConfig) -> None:
    """Make the file."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    os.posix_fallocate(handle, 0, shown_dtype(board).itemsize)
    os.close(handle)


class WipedBoard:
    """The effect of a pad on the board of a simulated robot.

    Args:
        path: of the file that `create_shown` made.
        config: of the board.
        pad_half: half edges of the pad, m.
        boards: what is drawn.
        seed: of the drawings.
        rounds: boards of the run; afterwards nobody draws.
        first_s: when the first one is drawn, s since the robot was taken over.
    """

    def __init__(
        self, path: Path, config: BoardConfig, pad_half: Sequence[float], boards: Boards, seed: int, rounds: int,
        first_s: float = 0.0,
    ):  # fmt: skip
        self._path, self._config, self._pad_half = path, config, pad_half
        self._boards, self._seed, self._rounds = boards, seed, min(rounds, _MOST)
        self._first_tick = round(1000.0 * first_s)

    def begin(self, model: mujoco.MjModel) -> None:
        """Hang up an empty board, in the simulator's process."""
        del model
        self._shown = map_shown(self._path, self._config)
        self._board = Whiteboard(self._config)
        self._board.cells = self._shown["cells"][0]
        self._away, self._visited, self._drawings = 0, False, self._all_drawings()
        self._shown["number"] = -1

    def _all_drawings(self) -> list[np.ndarray]:
        """Draw on all boards of the run at once: that compiles, and takes longer than a tick. Wipe one, likewise."""
        rng, drawings, board = np.random.default_rng(self._seed), [], Whiteboard(self._config)
        for _ in range(self._rounds):
            paint_board(board, self._boards, rng)
            drawings.append(board.cells.copy())
        self._wipe(board.cells, np.zeros(3), np.eye(3))
        return drawings

    def _draw(self, number: int) -> None:
        shown = self._shown[0]
        self._board.cells[:], self._visited = self._drawings[number], False
        shown["number"] = number
        shown["ink_start"][number] = shown["ink"][number] = self._board.ink_cells

    def _wipe(self, cells: np.ndarray, position: np.ndarray, rotation: np.ndarray) -> int:
        x, y = self._board.origin
        return erase_under_pad(cells, x, y, self._config.cell, position, rotation, *self._pad_half[:2])

    def after_step(self, tick: int, q: np.ndarray, position: np.ndarray, rotation: np.ndarray, force_n: float) -> None:
        """Wipe, and draw anew where all is clean and the arm is away."""
        shown, config = self._shown[0], self._config
        shown["tick"], shown["q"] = tick, q
        if tick % _ERASE_EVERY == 0 and force_n > config.press_n:
            erased = self._wipe(self._board.cells, position, rotation)
            if erased and shown["number"] >= 0:
                shown["ink"][shown["number"]] = np.count_nonzero(self._board.cells == INK)
        is_away = position[2] > config.centre[2] + _AWAY_M
        self._away = self._away + 1 if is_away else 0
        self._visited = self._visited or not is_away
        if self._is_drawn_on(tick, int(shown["number"])):
            self._away = 0
            self._draw(int(shown["number"]) + 1)

    def _is_drawn_on(self, tick: int, number: int) -> bool:
        """Tell whether somebody draws now: once the arm is away from a board that is clean, or has left it for long."""
        if number < 0:
            return tick >= self._first_tick
        shown = self._shown[0]
        clean = shown["ink"][number] <= 0.05 * shown["ink_start"][number]
        left = self._away > _AWAY_TICKS if clean else self._visited and self._away > _LEFT_TICKS
        return bool(left and number + 1 < self._rounds)
