"""Exciting trajectories: motions of all joints that show friction, rotors and payload, within what the arm can do."""

import io
from pathlib import Path
from typing import NamedTuple

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.files import write_whole
from contactsafe.logs.clearance import Clearance
from contactsafe.logs.impulses import impulses_of
from contactsafe.logs.smoothing import Signals
from contactsafe.logs.unknowns import Unknowns, problem_of, shapes_of
from contactsafe.robot.arm import Arm, finite_range, require_arm
from contactsafe.robot.regressor import motion_of, nominal_terms

SECONDS, RATES_HZ = (5.0, 600.0), (50.0, 2000.0)

_HARMONICS = 5
_PERIOD_S = 10.0
"""Of the lowest harmonic; the highest has a fifth of it."""

_REST_S, _RAMP_S = 0.5, 1.5
"""At rest at both ends, and from there to full motion."""

_MARGIN = 0.05
"""Fraction of a joint's range that is left free at either end."""

_SPEED, _UNKNOWN_SPEED, _TORQUE = 0.6, 1.0, 0.7
"""Fractions of the limits of speed and torque; rad/s where no limit is known."""

_CANDIDATES = 12
_CHECKED_HZ, _WEIGHED_HZ = 20.0, 50.0


class Trajectory(NamedTuple):
    """A motion from home to home.

    Attributes:
        time: (T,), s.
        q, qd: (T, n), rad and rad/s.
        condition: condition number of what is to be identified from it, in units of what is plausible.
    """

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    condition: float


def excitation(
    arm: Arm, seconds: float = 30.0, rate_hz: float = 1000.0, seed: int = 0, floor_m: float | None = None
) -> Trajectory:
    """Return the best of some random Fourier series, by the condition number of the regressor (Swevers et al. 1997).

    It begins and ends at home, at rest; it keeps to 60 % of the speed limits and 70 % of the torque limits, away from
    the ends of the joints' ranges, from the arm itself, and above the floor.

    Args:
        arm: by its description, with what the tool carries as far as it is known.
        seconds: how long.
        rate_hz: of its rows.
        seed: of the search.
        floor_m: height of a table below everything but base and first link, world, m; None for none.

    Raises:
        InvalidInputError: a number that cannot be, or no room to move about home.
    """
    require_arm(arm)
    for name, value, (low, high) in (("seconds", seconds, SECONDS), ("rate", rate_hz, RATES_HZ)):
        if not low <= value <= high:
            raise InvalidInputError(f"{name} = {value:g}; give {low:g} to {high:g}")
    rng, clearance = np.random.default_rng(seed), Clearance(arm, floor_m)
    best: tuple[float, np.ndarray] | None = None
    for _ in range(_CANDIDATES):
        series = _scaled(arm, clearance, seconds, _sampled(arm, rng))
        if series is None:
            continue
        condition = _condition(arm, *_motion(arm, series, _times(seconds, _WEIGHED_HZ), seconds))
        if best is None or condition < best[0]:
            best = condition, series
    if best is None:
        raise InvalidInputError(
            f"arm '{arm.name}' has no room to move about its home; give another home, or a lower floor"
        )
    time = _times(seconds, rate_hz)
    return Trajectory(time, *_motion(arm, best[1], time, seconds), best[0])


def _times(seconds: float, rate_hz: float) -> np.ndarray:
    return np.arange(round(seconds * rate_hz) + 1) / rate_hz


def _sampled(arm: Arm, rng: np.random.Generator) -> np.ndarray:
    """Sample sine and cosine amplitudes of each joint's harmonics, (n, K, 2), rad: up to its range about home."""
    low, high = finite_range(arm.q_min, arm.q_max)
    room = np.maximum(np.minimum(high - arm.home, arm.home - low) - _MARGIN * (high - low), 0.0)
    series = rng.normal(size=(arm.n, _HARMONICS, 2)) / np.sqrt(np.arange(1, _HARMONICS + 1))[:, None]
    return np.minimum(room, 1.5)[:, None, None] * series / np.abs(series).sum(axis=(1, 2), keepdims=True) * 2.0


def _motion(arm: Arm, series: np.ndarray, time: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Return q and q̇ of a series, (T, n) each: home at both ends, without a step in acceleration."""
    w = 2.0 * np.pi / min(_PERIOD_S, seconds - 2.0 * _REST_S) * np.arange(1, _HARMONICS + 1)
    phase = np.outer(time, w)
    wave = np.sin(phase) @ series[:, :, 0].T + np.cos(phase) @ series[:, :, 1].T
    rate = (np.cos(phase) * w) @ series[:, :, 0].T - (np.sin(phase) * w) @ series[:, :, 1].T
    rise, slope = _ramp((time - _REST_S) / _RAMP_S)
    fall, drop = _ramp((seconds - _REST_S - time) / _RAMP_S)
    window, change = rise * fall, (slope * fall - rise * drop) / _RAMP_S
    return arm.home + window[:, None] * wave, window[:, None] * rate + change[:, None] * wave


def _ramp(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the polynomial of least jerk from 0 to 1, and its slope."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2), 30.0 * x**2 * (1.0 - x) ** 2


def _scaled(arm: Arm, clearance: Clearance, seconds: float, series: np.ndarray) -> np.ndarray | None:
    """Return a series made small enough for every limit; None where the arm itself leaves it no room."""
    time = _times(seconds, _CHECKED_HZ)
    for _ in range(16):
        q, qd = _motion(arm, series, time, seconds)
        worst = _use(arm, time, q, qd)
        if (worst > 1.0).any():
            series = series / np.maximum(1.02 * worst, 1.0)[:, None, None]
        elif clearance.is_free(q):
            return series
        else:
            series = 0.85 * series
    return None


def _use(arm: Arm, time: np.ndarray, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Return which multiple of what each joint may have it uses, of position, speed and torque the largest, (n,)."""
    low, high = finite_range(arm.q_min, arm.q_max)
    margin = _MARGIN * (high - low)
    off = q - arm.home
    room = np.where(off > 0.0, high - margin - arm.home, arm.home - low - margin)
    used = (np.abs(off) / np.maximum(room, 1e-6)).max(axis=0)
    fastest = np.where(np.isfinite(arm.qd_max), _SPEED * arm.qd_max, _UNKNOWN_SPEED)
    used = np.maximum(used, np.abs(qd).max(axis=0) / fastest)
    p, beta = nominal_terms(arm, motion_of(arm, q, qd), qd, rotors=True)
    torque = np.abs(np.gradient(p, time, axis=0) + beta).max(axis=0)
    at_rest = np.abs(arm.dynamics(arm.home, np.zeros(arm.n))["g"])
    room_nm = np.maximum(_TORQUE * arm.tau_max, at_rest + 0.1 * arm.tau_max)
    return np.maximum(used, np.where(torque > room_nm, 1.25, 0.0))


def _condition(arm: Arm, q: np.ndarray, qd: np.ndarray) -> float:
    time = np.arange(len(q)) / _WEIGHED_HZ
    nothing = np.zeros(arm.n)
    signals = Signals(time, q, qd, None, qd, np.ones(len(time), dtype=bool), nothing, nothing)
    shapes = shapes_of(arm, behind_gears=False)[:2]
    impulses = impulses_of(arm, signals, np.zeros_like(q), shapes)
    problem = problem_of(arm, Unknowns(arm.n, False, False, True), impulses, np.ones(arm.n, dtype=int))
    columns = problem.columns * problem.spread / arm.tau_max[:, None]
    return float(np.linalg.cond(columns.reshape(-1, columns.shape[2])))


def write_trajectory(path: Path, motion: Trajectory) -> None:
    """Write a trajectory as CSV: time, q_0 …, qd_0 …, whole or not at all.

    Raises:
        OutputError: it cannot be written.
    """
    n = motion.q.shape[1]
    text = io.StringIO()
    header = ",".join(["time", *(f"q_{i}" for i in range(n)), *(f"qd_{i}" for i in range(n))])
    rows = np.hstack([motion.time[:, None], motion.q, motion.qd])
    np.savetxt(text, rows, delimiter=",", fmt="%.9g", header=header, comments="")
    write_whole(path, text.getvalue().encode())
