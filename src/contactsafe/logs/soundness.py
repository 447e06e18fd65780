"""Logs from which nothing can be identified, refused with the remedy."""

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.logs.fitting import Fit
from contactsafe.logs.impulses import WINDOW_S, whole_windows
from contactsafe.logs.log import Log
from contactsafe.logs.smoothing import Signals
from contactsafe.robot.arm import Arm

LEAST_S = 2.0
LEAST_WINDOWS = 18
"""One fewer than a log of `LEAST_S` without gaps has: half of them must show what the other half does."""

_LEAST_RAD = 0.05
"""A log in which no joint moves so far shows nothing."""

RATES_HZ = (50.0, 20000.0)

_OUTLIER = 8.0
"""Standard deviations (by the median) of a residual that is no noise."""

_LARGE = 0.03
"""Fraction of a joint's torque limit below which no residual is a contact's."""


def refuse_unfit(log: Log, arm: Arm) -> None:
    """Refuse a log that is another arm's, too short, too slow, or at rest.

    Raises:
        InvalidInputError: as it says.
    """
    if log.n != arm.n:
        raise InvalidInputError(f"{log.source} has {log.n} joints, arm '{arm.name}' has {arm.n}; give the right robot")
    rate_hz, (low, high) = 1.0 / log.step_s, RATES_HZ
    if not low <= rate_hz <= high:
        bursts = (
            "; if they were stamped in bursts as they arrived, give their rate, --rate HZ" if rate_hz > high else ""
        )
        raise InvalidInputError(
            f"{log.source} has {rate_hz:.3g} rows a second by its time; record {low:g} to {high:.0f}{bursts}"
        )
    if log.seconds < LEAST_S:
        raise InvalidInputError(
            f"{log.source} is {log.seconds:.2g} s long; record {LEAST_S:g} s or more, better 30, see "
            "`contactsafe record`"
        )
    moved = np.ptp(log.q, axis=0)
    if moved.max() < _LEAST_RAD:
        raise InvalidInputError(
            f"{log.source} is of an arm at rest: no joint moves by more than {moved.max():.2g} rad; record a motion of "
            "all joints, see `contactsafe record`"
        )


def refuse_gaps(log: Log, signals: Signals) -> None:
    """Refuse a log of which hardly a window is without missing rows.

    Raises:
        InvalidInputError: as it says.
    """
    left = int(whole_windows(signals).sum())
    if left < LEAST_WINDOWS:
        raise InvalidInputError(
            f"{log.source}: rows are missing in all but {left} windows of {WINDOW_S:g} s, and {LEAST_WINDOWS} are "
            "needed; record without losing rows"
        )


def refuse_contact(log: Log, arm: Arm, found: Fit) -> None:
    """Refuse a log in which something touches the arm: for a while one joint's residual is far from all others.

    Raises:
        InvalidInputError: with the time, from and to.
    """
    residual = np.where(found.problem.counts, np.abs(found.solution.residual), 0.0)  # what holds a joint is no contact
    usual = 1.4826 * np.nanmedian(np.where(found.problem.counts, residual, np.nan), axis=0)
    large = residual > np.maximum(_OUTLIER * usual, _LARGE * arm.tau_max)
    lasting = large[1:] & large[:-1]
    if not lasting.any():
        return
    joint = int(np.argmax(np.where(lasting.any(axis=0), residual.max(axis=0) / arm.tau_max, 0.0)))
    rows, time = np.flatnonzero(lasting[:, joint]), found.impulses.time
    raise InvalidInputError(
        f"{log.source}: something touches the arm from {time[rows[0]]:.2f} to {time[rows[-1] + 1]:.2f} s: the residual "
        f"of joint {joint + 1} is {residual[rows, joint].max():.2g} N m there and {usual[joint]:.2g} N m elsewhere; "
        "record free motion"
    )
