"""Identification: how far the links' masses are from the model's, from the residual while nothing touches the arm."""

import math

import numpy as np

from contactsafe.control.laws import identify_masses
from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot, matvec_into
from contactsafe.core.stack import stack_vector
from contactsafe.robot.dynamics import mass_regressor

_f = np.float64
_i = np.int64

_SIGMAS = 3.0
"""Relative mass errors beyond this many standard deviations are not believed."""

CORRELATED = 10.0
"""Readings of one joint's residual, a few ms apart, err alike: so many of them count as one."""

NOISE_NM = 0.15
"""Standard deviation of a residual beside what friction, inertia and delay come to."""

FORGET_S = 8.0
"""Time after which what was identified is as uncertain as before."""

_SETTLE_TICKS = 40


def link_masses_dtype(n: int) -> np.dtype:
    """Describe what is known of the links' masses."""
    return np.dtype(
        [
            ("mass_error", _f, (n + 1,)),  # relative, of the links and of the tool
            ("covariance", _f, (n + 1, n + 1)),
            ("gravity_sigma", _f, (n,)),  # standard deviation of the gravity torque, N m
            ("gravity_correction", _f, (n,)),  # of `dynamics.g`, N m; the laws take it off the command
            ("ticks", _i),  # since the start
        ]
    )


@compiled
def start_link_masses(masses: Record, regressor: Matrix, variance: Vector) -> None:
    """Begin with the masses of the model, as uncertain as is said."""
    reset_link_masses(masses, variance)
    for i in range(masses.gravity_sigma.shape[0]):
        masses.gravity_sigma[i] = _gravity_sigma(masses.covariance, regressor[i])


@compiled
def reset_link_masses(masses: Record, variance: Vector) -> None:
    """Forget what was identified."""
    masses.mass_error[:] = 0.0
    masses.covariance[:] = 0.0
    for j in range(variance.shape[0]):
        masses.covariance[j, j] = variance[j]


@inlined
def correct_gravity(masses: Record, dynamics: Record, handle: Record, has_wrench: int, variance: Vector) -> None:
    """Add what the links were found to be heavier than the model says to the model's gravity torque.

    The corrected gravity is for the observer and the bounds. The laws take the correction off the command again: a mass
    that was identified wrongly, from a light touch, does not move the arm.

    Args:
        masses: `link_masses_dtype` record; its correction is set.
        dynamics: `dynamics_dtype` record; g and the regressor are updated.
        handle: of the nominal model, up to date.
        has_wrench: whether a force sensor tells: the tool's own weight then shows in the wrench and cancels.
        variance: of the relative mass errors, (n + 1,); all 0 to trust the model.
    """
    if not variance.any():
        return
    mass_regressor(handle, dynamics.mass_regressor)
    if has_wrench != 0:
        dynamics.mass_regressor[:, -1] = 0.0
    matvec_into(dynamics.mass_regressor, masses.mass_error, masses.gravity_correction)
    for i in range(masses.gravity_correction.shape[0]):
        dynamics.g[i] += masses.gravity_correction[i]


@inlined
def identify_link_masses(
    masses: Record,
    i: int,
    residual: float,
    model_uncertainty: float,
    row: Vector,
    dt: float,
    untouched: bool,
    variance: Vector,
) -> None:
    """Identify the links' masses from joint i's residual, where nothing touches the arm and a sensor shows the tool.

    Without a force sensor nothing is identified, and with one the tool's weight does not show: what is not known of
    them stays what it was at first.

    Args:
        masses: `link_masses_dtype` record; advanced.
        i: joint.
        residual: there, N m.
        model_uncertainty: there, N m.
        row: its gravity torque per relative mass error, (n + 1,), N m.
        dt: that passed, s.
        untouched: whether the residual is known to be weight.
        variance: of the relative mass errors at first, (n + 1,).
    """
    if not variance.any():
        return
    if untouched:
        _forget(masses.covariance, variance, dt)
    masses.ticks += 1
    if untouched and masses.ticks > _SETTLE_TICKS:
        error = NOISE_NM + model_uncertainty
        largest = _SIGMAS * np.sqrt(variance)
        identify_masses(masses.mass_error, masses.covariance, row, -residual, CORRELATED * error * error, largest)
    masses.gravity_sigma[i] = _gravity_sigma(masses.covariance, row)


@compiled
def _forget(covariance: Matrix, variance: Vector, dt: float) -> None:
    """Let what was identified get out of date; not in a contact, which would raise the thresholds under it."""
    for j in range(variance.shape[0]):
        covariance[j, j] = min(covariance[j, j] + variance[j] * dt / FORGET_S, variance[j])


@compiled
def _gravity_sigma(covariance: Matrix, row: Vector) -> float:
    """Return the standard deviation of what a joint's gravity torque differs from the model's, N m."""
    P_row = matvec_into(covariance, row, stack_vector(row.shape[0]))
    return math.sqrt(max(dot(row, P_row), 0.0))
