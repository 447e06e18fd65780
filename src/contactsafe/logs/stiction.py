"""Stiction from a log of commands: the torque at which joints that rest break away."""

import numpy as np

from contactsafe.logs.fitting import Fit
from contactsafe.logs.smoothing import Signals
from contactsafe.robot.arm import Arm
from contactsafe.robot.regressor import link_regressor, motion_of, nominal_terms

_REST_RAD_S, _MOVES_RAD_S = 0.004, 0.03
_REST_S, _START_S = 0.15, 0.3
"""A joint rests for so long, and moves so soon after it."""

_BEFORE_S = 0.06
"""Before it moves, in which the torque that it takes is largest."""

_SMOOTH_S = 0.02
"""Over which the torque is averaged: as long as its noise is smoothed elsewhere, a third of the time looked at."""


def breakaway_torque(arm: Arm, signals: Signals, found: Fit) -> np.ndarray:
    """Return the torque that each joint takes before it moves, the median of its starts, (n,), N m; NaN without one.

    Args:
        arm: by its description.
        signals: of a log with commands.
        found: fit of the commands.
    """
    step = signals.step_s
    torque = np.full(arm.n, np.nan)
    for i in range(arm.n):
        starts = _starts(signals.qd[:, i], signals.whole, step)
        taken = [_taken(arm, signals, found, i, start, step) for start in starts]
        if taken:
            torque[i] = float(np.median(taken))
    return torque


def _starts(qd: np.ndarray, whole: np.ndarray, step: float) -> list[int]:
    """Return the rows in which a joint begins to move after it rested, with no rows missing about them."""
    rest, moves = np.abs(qd) < _REST_RAD_S, np.abs(qd) > _MOVES_RAD_S
    long, soon = max(2, round(_REST_S / step)), max(2, round(_START_S / step))
    ends = np.flatnonzero(rest[:-1] & ~rest[1:]) + 1
    return [
        int(end)
        for end in ends
        if end >= long
        and rest[end - long : end].all()
        and moves[end : end + soon].any()
        and whole[end - long : end + soon].all()
    ]


def _taken(arm: Arm, signals: Signals, found: Fit, joint: int, start: int, step: float) -> float:
    """Return the largest torque of a joint about a start that neither links, load, rotor nor bias need, N m."""
    before, after, smooth = (max(2, round(seconds / step)) for seconds in (_BEFORE_S, 0.5 * _BEFORE_S, _SMOOTH_S))
    rows = slice(max(0, start - before), min(len(signals.q), start + after))
    q, qd = signals.q[rows], signals.qd[rows]
    motion = motion_of(arm, q, qd)
    p, beta = nominal_terms(arm, motion, qd, rotors=False)
    p_load, beta_load = link_regressor(arm, motion, arm.n)
    p, beta = p + p_load @ found.load() + found.of("rotor") * qd, beta + beta_load @ found.load()
    command = np.zeros_like(q) if signals.command is None else signals.command[rows]
    left = (command - beta - np.gradient(p, step, axis=0))[:, joint] - found.of("bias")[joint]
    left -= found.of("viscous")[joint] * qd[:, joint]
    smoothed = np.convolve(left, np.full(smooth, 1.0 / smooth), "valid")
    return float(np.abs(smoothed).max())
