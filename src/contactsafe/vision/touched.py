"""Where a calibration target lies, from outer corners of it that a robot's tool touched."""

import itertools
from collections.abc import Mapping

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.charuco import CharucoTarget
from contactsafe.vision.rigid import Fit, fit_rigid

_APART_M = 0.003
"""By which the distance of two touched corners may differ from the target's: pen, paper and a hand's aim."""

_UP = 0.8
"""Least height of the unit vector out of the target: it lies on something, the printed side up."""


def place_target(target: CharucoTarget, touched: Mapping[str, np.ndarray]) -> Fit:
    """Find the target's pose from corners that were touched.

    Three corners tell it; a fourth one shows, by the residual, how well.

    Args:
        target: that was touched.
        touched: where each named corner was, (3,), m, in the robot's base.

    Returns:
        The target's pose in the base, and the residual.

    Raises:
        InvalidInputError: fewer than three corners or unknown ones, distances that are not the target's, corners
            along one line, or a target that lies face down: corners were mixed up.
    """
    named = target.named
    unknown = [letter for letter in touched if letter not in named]
    if unknown or len(touched) < 3:
        raise InvalidInputError(
            f"corners {', '.join(touched) or 'none'} were touched; give three or more of {', '.join(named)}"
        )
    measured = {letter: np.asarray(place, dtype=float) for letter, place in touched.items()}
    if not all(place.shape == (3,) and np.isfinite(place).all() for place in measured.values()):
        raise InvalidInputError("a touched corner is not three finite numbers; give x, y, z, m")
    for a, b in itertools.combinations(measured, 2):
        found, printed = np.linalg.norm(measured[a] - measured[b]), np.linalg.norm(named[a] - named[b])
        if abs(found - printed) > _APART_M:
            raise InvalidInputError(
                f"corners {a} and {b} were touched {1000 * found:.1f} mm apart, on the target they are "
                f"{1000 * printed:.1f} mm, allowed {1000 * _APART_M:g} mm more or less; touch them again, and measure "
                "the printed squares"
            )
    fit = fit_rigid(np.array([named[letter] for letter in measured]), np.array(list(measured.values())))
    if fit.pose[2, 2] < _UP:
        lying, allowed = np.degrees(np.arccos(np.clip([fit.pose[2, 2], _UP], -1.0, 1.0)))
        raise InvalidInputError(
            f"the target's printed side is turned {lying:.0f}° from upwards, allowed {allowed:.0f}°; touch each corner "
            "at its letter"
        )
    return fit
