"""How a run ended, and how it went until then."""

import os
from dataclasses import dataclass

import numpy as np

from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.states import REASONS, STATES, STOPPED, WELL
from contactsafe.hardware.status import BUSY_BINS

BUSY_EDGES_US = (20, 40, 60, 80, 120, 250, 500, BUSY_BINS)
"""Of the bins that the busy part of a tick is counted in; the last one holds all that took longer."""


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
        busy_ticks: in how many ticks it was below each of `BUSY_EDGES_US`, and not below the one before.
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
    busy_ticks: tuple[int, ...] = (0,) * len(BUSY_EDGES_US)


def ending_of(exchange: Exchange) -> Ending:
    """Return how a run ended."""
    status = exchange.status[0]
    state, reason = int(status["state"]), int(status["reason"])
    counts = np.cumsum(status["busy"])
    median, late, most = (int(np.searchsorted(counts, fraction * counts[-1])) for fraction in (0.5, 0.99, 1.0))
    ended_well, unwritten = state == STOPPED and reason in WELL, int(status["recorder_errno"])
    remedies = [] if ended_well else [REASONS[reason].remedy]
    if cut := _why_cut_short(status):
        remedies.append(f"its log ends early: {cut}")
    return Ending(
        STATES[state], REASONS[reason].name, "; ".join(remedies), ended_well and not cut, int(status["tick"]),
        int(status["refused"]), int(status["lost"]), float(status["first_step_nm"]), float(status["largest_step_nm"]),
        (median, late, most, int(status["busy"][500:].sum())), _recorded(status), unwritten,
        tuple(int(part.sum()) for part in np.split(status["busy"], BUSY_EDGES_US[:-1])),
    )  # fmt: skip


def _why_cut_short(status: np.void) -> str:
    """Return why a log lacks the end of its run and what to do, empty where it does not."""
    number = int(status["recorder_errno"])
    if number > 0:
        return f"{os.strerror(number)}; give it another place"
    if number < 0:
        return "see what the recorder said above"
    died = status["pid_recorder"] != 0 and status["recorded"] < status["rows"]
    return "the recorder was ended; see what ended it" if died else ""


def _recorded(status: np.void) -> int:
    """Return how many ticks are in the log: not where the run begins, nor what the recorder was too late for."""
    return max(int(status["recorded"]) - int(status["dropped"]) - 1, 0)
