"""Signals of a log as identification takes them: evenly spaced, smoothed without delay, the quieter velocity."""

import math
from typing import NamedTuple

import numpy as np

from contactsafe.logs.log import Log

_HALF_WIDTH_S = 0.02
"""Half the width of the cubic that is fitted about each row; of motion below 5 Hz it loses less than 1 %."""

_GAP, _GAP_S = 3.0, 0.01
"""Multiple of the usual time between two rows, and time, beyond which rows are missing; less is bridged."""


class Signals(NamedTuple):
    """What a log says at T evenly spaced times, but for gaps, of which a few rows stand for each.

    Attributes:
        time: (T,), s.
        q, qd: joint positions and velocities, (T, n), rad and rad/s.
        torque, command: joint torques as in `Log`, (T, n), N m; None where they were not recorded.
        whole: whether nothing was missing there, (T,).
        velocity_noise: that was smoothed away, standard deviation, (n,), rad/s.
        torque_noise: likewise of the measured torque, or of the command where there is none, (n,), N m.
    """

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    torque: np.ndarray | None
    command: np.ndarray | None
    whole: np.ndarray
    velocity_noise: np.ndarray
    torque_noise: np.ndarray

    @property
    def step_s(self) -> float:
        """Time between two rows that are no gap, s."""
        return float(np.median(np.diff(self.time)))


def signals_of(log: Log) -> Signals:
    """Return a log at even times; torques stay as they were recorded, for integrals over windows smooth them."""
    step = log.step_s
    most = max(_GAP * step, _GAP_S)
    # However long a gap is, it takes its least: two runs days apart would fill the memory.
    told = np.concatenate([[0.0], np.cumsum(np.minimum(np.diff(log.time), most))])
    even = np.arange(0.0, told[-1] + 0.5 * step, step)
    before = np.clip(np.searchsorted(told, even, side="right") - 1, 0, len(told) - 2)
    whole = np.diff(log.time)[before] < most
    half = max(2, round(_HALF_WIDTH_S / step))
    whole = np.convolve(~whole, np.ones(2 * half + 3), "same") < 0.5  # what is missing is smoothed into its neighbours
    value, slope = _kernels(half, step)
    q = _even(told, log.q, even)
    inner = slice(half, len(even) - half)
    qd, noise = _smoothed(q, slope), _noise(np.gradient(q, step, axis=0)[inner], value, whole[inner])
    if log.qd is not None:
        own = _even(told, log.qd, even)
        own_noise = _noise(own[inner], value, whole[inner])
        quieter = own_noise <= noise
        qd, noise = np.where(quieter, _smoothed(own, value), qd), np.where(quieter, own_noise, noise)
    recorded = {name: getattr(log, name) for name in ("torque", "command")}
    drives = {name: _even(told, values, even)[inner] for name, values in recorded.items() if values is not None}
    return Signals(
        np.interp(even, told, log.time)[inner],
        _smoothed(q, value),
        qd,
        drives.get("torque"),
        drives.get("command"),
        whole[inner],
        noise,
        _noise(next(iter(drives.values())), value, whole[inner]),
    )


def _even(time: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(at, time, column) for column in values.T], axis=1)


def _kernels(half: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return weights of the value and of the slope of a cubic through 2 half + 1 rows (Savitzky and Golay 1964)."""
    powers = np.vander(step * np.arange(-half, half + 1), 4, increasing=True)
    inverse = np.linalg.pinv(powers / step ** np.arange(4)) / step ** np.arange(4)[:, None]
    return inverse[0], inverse[1]


def _smoothed(values: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    return np.stack([np.convolve(column, kernel[::-1], "valid") for column in values.T], axis=1)


def _noise(values: np.ndarray, kernel: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Return the standard deviation of what a smoothing takes off, made up for what it leaves, (n,).

    Rows about a gap count only where there are no others.
    """
    half = len(kernel) // 2
    rest = values[half : len(values) - half] - _smoothed(values, kernel)
    counts = whole[half : len(values) - half]
    rest = rest[counts] if counts.any() else rest
    kept = 1.0 - 2.0 * kernel[half] + float(kernel @ kernel)
    return np.sqrt(np.mean(rest**2, axis=0) / max(kept, math.ulp(1.0)))
