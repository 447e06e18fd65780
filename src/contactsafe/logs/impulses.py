"""Impulses over windows of a log, in which identification compares torque with momentum: no acceleration is needed.

What drives a joint over a window is ∫(τ − β) dt = p₂ − p₁, with momentum p and β = g − Cᵀ q̇; both sides are linear in
all that is to be identified. Divided by the window's length they are mean torques, N m. See
`docs/concepts/identification.md`.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from contactsafe.logs.smoothing import Signals
from contactsafe.robot.arm import Arm
from contactsafe.robot.regressor import link_regressor, motion_of, nominal_terms

WINDOW_S = 0.1
"""Long enough that the noise of velocity at its ends is little, short against a motion's period."""

SLOW_RAD_S = 0.02
"""Below, a joint may stick, and friction is whatever holds it."""

_ROWS = 4000
"""Of which the regressors are in memory at a time."""


class Impulses(NamedTuple):
    """Mean torques over N windows.

    Attributes:
        time: of the windows' middles, (N,), s.
        driving: what drives the joints less what the model's links need, (N, n), N m.
        speed: mean velocity, (N, n), rad/s.
        acceleration: mean acceleration, (N, n), rad/s².
        steps: mean of the step of each friction shape, one each, (N, n).
        moving: whether the joint moved in one direction fast enough for its friction to be known, (N, n).
        load: per inertial parameter of what the last link carries, (N, n, 10).
    """

    time: np.ndarray
    driving: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    moving: np.ndarray
    steps: tuple[np.ndarray, ...]
    load: np.ndarray

    def part(self, which: np.ndarray | slice) -> "Impulses":
        """Return some of the windows."""
        return Impulses(
            self.time[which],
            self.driving[which],
            self.speed[which],
            self.acceleration[which],
            self.moving[which],
            tuple(step[which] for step in self.steps),
            self.load[which],
        )


def impulses_of(arm: Arm, signals: Signals, torque: np.ndarray, shapes: tuple[np.ndarray, ...]) -> Impulses:
    """Integrate a log over windows; those in which rows are missing are left out.

    Args:
        arm: of n joints.
        signals: of T rows.
        torque: which is taken to drive the links, (T, n), N m.
        shapes: of friction to compare, φ2 s/rad and φ3 rad/s of every joint, (n, 2) each; see `friction_step`.
    """
    step, rows = _window(signals)
    found: list[Impulses] = []
    for part in _parts(len(signals.time), rows):
        q, qd, rate = signals.q[part], signals.qd[part], 1.0 / (rows * step)
        motion = motion_of(arm, q, qd)
        p, beta = nominal_terms(arm, motion, qd, rotors=False)
        p_load, beta_load = link_regressor(arm, motion, arm.n)
        found.append(
            Impulses(
                signals.time[part][:-1:rows] + 0.5 * rows * step,
                rate * (_windows(torque[part] - beta, rows, step) - np.diff(p[::rows], axis=0)),
                rate * _windows(qd, rows, step),
                rate * np.diff(qd[::rows], axis=0),
                _moving(qd, rows),
                tuple(rate * _windows(friction_step(shape, qd), rows, step) for shape in shapes),
                rate * (_windows(beta_load, rows, step) + np.diff(p_load[::rows], axis=0)),
            ).part(_whole(signals.whole[part], rows))
        )
    return Impulses(
        np.concatenate([one.time for one in found]),
        np.concatenate([one.driving for one in found]),
        np.concatenate([one.speed for one in found]),
        np.concatenate([one.acceleration for one in found]),
        np.concatenate([one.moving for one in found]),
        tuple(np.concatenate([one.steps[k] for one in found]) for k in range(len(shapes))),
        np.concatenate([one.load for one in found]),
    )


def whole_windows(signals: Signals) -> np.ndarray:
    """Tell in which windows of a log no row is missing, (N,)."""
    rows = _window(signals)[1]
    return _whole(signals.whole[: (len(signals.whole) - 1) // rows * rows + 1], rows)


def friction_step(shape: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Return Gaz's step in velocity for φ1 = 2, from about −1 to 1 and zero at rest, (T, n).

    Args:
        shape: φ2 s/rad and φ3 rad/s of every joint, (n, 2).
        qd: joint velocities, (T, n), rad/s.
    """
    steep, shift = shape.T
    return np.tanh(0.5 * steep * (qd + shift)) - np.tanh(0.5 * steep * shift)


def _window(signals: Signals) -> tuple[float, int]:
    """Return the time between two rows, s, and how many such times a window has."""
    return signals.step_s, max(2, round(WINDOW_S / signals.step_s))


def _whole(whole: np.ndarray, rows: int) -> np.ndarray:
    return _windows(1.0 - whole, rows, 1.0) < 0.5


def _parts(count: int, rows: int) -> Iterator[slice]:
    """Yield the rows of some windows at a time; the last of each is the first of the next."""
    windows, many = (count - 1) // rows, max(1, _ROWS // rows)
    for first in range(0, windows, many):
        last = min(first + many, windows)
        yield slice(first * rows, last * rows + 1)


def _moving(qd: np.ndarray, rows: int) -> np.ndarray:
    slow = np.abs(qd[:-1]) < SLOW_RAD_S
    return ~slow.reshape(-1, rows, qd.shape[1]).any(axis=1)


def _windows(values: np.ndarray, rows: int, step: float) -> np.ndarray:
    """Integrate over windows by the trapezoidal rule."""
    middle = 0.5 * step * (values[1:] + values[:-1])
    return middle.reshape(-1, rows, *values.shape[1:]).sum(axis=1)
