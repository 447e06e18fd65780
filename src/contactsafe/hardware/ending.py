"""How a run ended, and how it went until then."""

from dataclasses import dataclass

import numpy as np

from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.states import REASONS, STATES, STOPPED, WELL


@dataclass
class Ending:
    """How a run ended.

    Attributes:
        state, reason: by name.
        remedy: what a person is to do; empty where all went well.
        went_well: whether it ended as it should.
        ticks: of the control loop.
        refused: targets that were.
        lost: states of the robot that did not come.
        first_step_nm, largest_step_nm: changes of a torque, in the first command and in any other.
        busy_us: busy part of a tick: median, 99th percentile and most, µs, and ticks over 500 µs.
        recorded: ticks in the log.
        recorder_errno: why it ends early, 0 where it does not.
    """

    state: str
    reason: str
    remedy: str
    went_well: bool
    ticks: int
    refused: int
    lost: int
    first_step_nm: float
    largest_step_nm: float
    busy_us: tuple[int, int, int, int]
    recorded: int
    recorder_errno: int = 0


def ending_of(exchange: Exchange) -> Ending:
    """Return how a run ended."""
    board = exchange.board[0]
    state, reason = int(board["state"]), int(board["reason"])
    counts = np.cumsum(board["busy"])
    median, late, most = (int(np.searchsorted(counts, fraction * counts[-1])) for fraction in (0.5, 0.99, 1.0))
    well = state == STOPPED and reason in WELL and board["recorder_errno"] == 0
    return Ending(
        STATES[state], REASONS[reason].name, "" if well else REASONS[reason].remedy, bool(well), int(board["tick"]),
        int(board["refused"]), int(board["lost"]), float(board["first_step_nm"]), float(board["largest_step_nm"]),
        (median, late, most, int(board["busy"][500:].sum())), int(board["recorded"]), int(board["recorder_errno"]),
    )  # fmt: skip
