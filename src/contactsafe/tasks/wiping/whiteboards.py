"""The boards of N worlds and the cameras that look at them."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from contactsafe.core.arrays import Record
from contactsafe.core.compiled import compiled
from contactsafe.core.copying import Independent
from contactsafe.core.state import Entry, load_state_dict, of_array, of_records, state_dict
from contactsafe.sim.worlds import Worlds
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.camera import CameraTables, camera_tables, plane_homography, render_mask, stack_cameras
from contactsafe.tasks.wiping.ink import InkIndex, empty_ink_index, enter
from contactsafe.tasks.wiping.whiteboard import CLEAN, INK, OBJECT, Whiteboard, erase_under_pad

_ERASE_EVERY = 8  # ticks: at 0.4 m/s the pad moves 3 mm between, a twentieth of its width

board_dtype = np.dtype(
    [
        ("origin", float, (2,)),  # world corner of the board's first cell, m
        ("cell", float),  # m
        ("press_n", float),  # force with which the pad erases, N
        ("pad_half", float, (2,)),  # half edges of the pad, m
        ("camera", int),  # number of the camera that looks at it
    ]
)
"""One world's board, for compiled code."""


class BoardArrays(NamedTuple):
    """What compiled code needs of N boards: the arrays of `Whiteboards` by their names."""

    records: np.ndarray
    cells: np.ndarray
    masks: np.ndarray
    cameras: CameraTables
    ink_index: InkIndex


class Whiteboards(Independent):
    """N boards alike, their ink, and what cameras see of them.

    Args:
        config: of the boards.
        camera: as calibrated.
        models: of the worlds, for the shapes of the arm that hide ink.
        pad_half: half edges of the pad, m.

    Attributes:
        config, camera_config: as given.
        records: `board_dtype` records, (n,).
        cells: the boards, uint8, (n, rows, columns).
        boards: `Whiteboard` objects whose cells lie in `cells`.
        masks: what the cameras saw last, uint8, (n, size, size).
        camera: `CameraTables` as calibrated.
        cameras: those that look, side by side; `records["camera"]` says which one at which board.
        ink_index: `InkIndex` of the boards and cameras; `enter_changed` brings it up to date with what was drawn, a
            step with what was wiped.
        homography: of board plane to mask pixels, (3, 3).
    """

    _bound = ("boards",)

    def __init__(
        self, config: BoardConfig, camera: Camera, models: Sequence[mujoco.MjModel], pad_half: Sequence[float]
    ):
        self.config, self.camera_config, self.n = config, camera, len(models)
        board = Whiteboard(config)
        self.cells = np.zeros((self.n, *board.cells.shape), dtype=np.uint8)
        self.records = np.zeros(self.n, dtype=board_dtype)
        self.records["origin"], self.records["cell"] = board.origin, config.cell
        self.records["press_n"], self.records["pad_half"] = config.press_n, pad_half[:2]
        self.masks = np.full((self.n, camera.size, camera.size), 255, dtype=np.uint8)
        self.camera = camera_tables(camera, board, models[0])
        self.cameras = stack_cameras([self.camera])
        self.ink_index = empty_ink_index(self.n, board.cells.size, camera.size)
        self.homography = plane_homography(camera, config.centre[2])
        self._bind()

    def _bind(self) -> None:
        self.boards = [Whiteboard(self.config) for _ in range(self.n)]
        for board, cells in zip(self.boards, self.cells, strict=True):
            board.cells = cells

    @property
    def arrays(self) -> BoardArrays:
        """Arrays of the boards, for compiled code."""
        return BoardArrays(self.records, self.cells, self.masks, self.cameras, self.ink_index)

    def erase(self, start: int, stop: int, worlds: Worlds) -> None:
        """Erase what the pads wiped in the step that the worlds from start to stop have run; without the GIL."""
        _erase_some(start, stop, self.records, self.cells, worlds.records, worlds.metrics, worlds.samples)

    def state_entries(self) -> dict[str, Entry]:
        """List what decides the boards' future."""
        bounds = {"camera": (0, len(self.cameras.pixels) - 1), "pad_half": (-1e9, 1e9)}
        return {
            "records": of_records(self.records, bounds, fixed=("",)),
            "cells": of_array(self.cells, CLEAN, OBJECT),
            "masks": of_array(self.masks),
        }

    def state_dict(self) -> dict[str, Any]:
        """Return all that decides the boards' future, as plain values and arrays."""
        return state_dict(self.state_entries())

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Load a state."""
        load_state_dict(self.state_entries(), state)
        for i in range(self.n):
            self.enter_ink(i)

    def enter_ink(self, i: int) -> None:
        """Enter what lies on board i and where its camera shows it: it was painted on, or the camera changed."""
        enter(self.ink_index, i, self.cells[i], self.cameras.pixels[self.records[i]["camera"]])
        self.boards[i].changed = False

    def enter_changed(self) -> None:
        """Do so for every board that says it has changed."""
        for i, board in enumerate(self.boards):
            if board.changed:
                self.enter_ink(i)

    def render(self, worlds: np.ndarray) -> np.ndarray:
        """Render every camera's mask, uint8, (n, size, size), before the arms of `world_dtype` records."""
        for i in range(self.n):
            render_mask(self.camera, self.cells[i], worlds[i]["plant"], self.masks[i])
        return self.masks

    def ink_cells(self) -> np.ndarray:
        """Count the cells that hold ink, (n,)."""
        return np.count_nonzero(self.cells == INK, axis=(1, 2))


@compiled(nogil=True)
def _erase_some(
    start: int, stop: int, boards: np.ndarray, cells: np.ndarray, worlds: np.ndarray, metrics: np.ndarray,
    samples: np.ndarray,
) -> None:  # fmt: skip
    """Erase the boards from start to stop; the arrays are those of `Whiteboards` and `Worlds`."""
    for i in range(start, stop):
        erase(boards[i], cells[i], worlds[i].tick - metrics[i].ticks, metrics[i], samples[i])


@compiled
def erase(board: Record, cells: np.ndarray, tick: int, metrics: Record, samples: np.ndarray) -> None:
    """Erase what the pad wiped in one policy step.

    Args:
        board: `board_dtype` record.
        cells: the board's, uint8, (rows, columns).
        tick: number of the step's first tick since reset.
        metrics: `step_metrics_dtype` record of the step.
        samples: `sample_dtype` records of its ticks.
    """
    for k in range(metrics.ticks):
        if (tick + k) % _ERASE_EVERY != 0:
            continue
        sample = samples[k]
        force = sample.tip_force
        if np.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2) > board.press_n:
            erase_under_pad(
                cells, board.origin[0], board.origin[1], board.cell, sample.position, sample.rotation,
                board.pad_half[0], board.pad_half[1],
            )  # fmt: skip
