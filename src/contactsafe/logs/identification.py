"""Identification: what of a robot is other than its description says, from a log of free motion."""

from dataclasses import dataclass

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.logs.carried import Carried, carried_by
from contactsafe.logs.fitting import Fit, fit
from contactsafe.logs.log import Log
from contactsafe.logs.smoothing import Signals, signals_of
from contactsafe.logs.soundness import refuse_contact, refuse_gaps, refuse_unfit
from contactsafe.logs.stiction import breakaway_torque
from contactsafe.robot.arm import Arm, require_arm
from contactsafe.robot.calibrated import tool_name
from contactsafe.robot.calibration import Calibration

_SHOWN = 0.5
"""Fraction of what was not known beforehand that may be left of an unknown which the log shows."""

_WORSE = 1.02
"""By this factor the residual of the second half may grow: what is fitted to noise adds about 1 % to a description that
cannot be made better."""

_NOTHING = 5e-4
"""A residual of this fraction of the torque limit is none."""


@dataclass(frozen=True)
class Identification:
    """What was identified, and how well it predicts what it was not identified from.

    Attributes:
        log: of the robot.
        arm: by its description.
        calibration: what was found, from the whole log.
        fits: 'sensor' from torque measured behind the gears, 'losses' from commands; one or both.
        signals: of the log.
        carried: what the tool carries beside its description, with which everything else was identified.
    """

    log: Log
    arm: Arm
    calibration: Calibration
    fits: dict[str, Fit]
    signals: Signals
    carried: Carried

    @property
    def fit(self) -> Fit:
        """The fit of the torque that the estimator goes by: the measured one, if any."""
        return next(iter(self.fits.values()))

    @property
    def before(self) -> np.ndarray:
        """Residual of the second half by the arm's description, rms, (n,), N m; NaN where a joint only ever stuck."""
        return _rms(_second(self.fit.nominal), _second(self.fit.problem.counts))

    @property
    def after(self) -> np.ndarray:
        """Residual of the second half by what the first half shows, rms, (n,), N m; NaN likewise."""
        return _rms(_second(self.fit.check), _second(self.fit.problem.counts))

    @property
    def rms(self) -> tuple[float, float]:
        """Both over all joints that moved, N m."""
        if not self._moved.any():
            return np.nan, np.nan
        before, after = (float(np.sqrt(np.mean(part[self._moved] ** 2))) for part in (self.before, self.after))
        return before, after

    @property
    def _moved(self) -> np.ndarray:
        """Which joints count anywhere in the second half, (n,)."""
        return np.any(_second(self.fit.problem.counts), axis=0)

    @property
    def reduction(self) -> float:
        """By which fraction the residual of the second half, rms over all joints, is smaller."""
        before, after = self.rms
        return 1.0 - after / before if before != 0.0 else 0.0

    @property
    def fits_already(self) -> bool:
        """Whether the description leaves next to nothing."""
        nothing = self.before < _NOTHING * self.arm.tau_max
        return bool(self._moved.any() and nothing[self._moved].all())

    def not_shown(self, part: str) -> tuple[str, ...]:
        """Return what a fit does not show, a few words a joint, with how the joint moved.

        Args:
            part: key of `fits`.
        """
        found, said = self.fits[part], []
        moved, fastest = np.ptp(self.signals.q, axis=0), np.abs(self.signals.qd).max(axis=0)
        left = {name: found.found(name)[1] / found.problem.spread[found.unknowns.of(name)] for name in found.names}
        for i in range(self.arm.n):
            names = [name for name, fraction in left.items() if fraction[i] > _SHOWN]
            if names:
                said.append(
                    f"{', '.join(names)} of joint {i + 1}, which moved by {moved[i]:.2g} rad and at most "
                    f"{fastest[i]:.2g} rad/s"
                )
        return tuple(said)

    def verdict(self) -> str:
        """Return what came of it, in one line."""
        before, after = self.rms
        if self.fits_already:
            return f"the description fits this log already: its residual is {before:.3g} N m rms"
        return (
            f"identified on the first half, the residual of the second half is {self.reduction:.0%} smaller: "
            f"{before:.3g} → {after:.3g} N m rms"
        )


def identify(log: Log, arm: Arm) -> Identification:
    """Identify friction, rotors, payload, sensor bias and noise from a log of free motion.

    Torque measured behind the gears shows what the sensors add and what is carried; commands show friction and rotors
    as well. The first half of the log is checked on the second, and what is returned is identified from all of it.

    Args:
        log: nothing touches the arm in it, and every joint moves.
        arm: by its description, with the tool that it had.

    Raises:
        InvalidInputError: the log is of another number of joints, too short, hardly moves, or shows a contact; or the
            second half gets worse by what the first shows.
    """
    require_arm(arm)
    refuse_unfit(log, arm)
    signals, fits = signals_of(log), dict[str, Fit]()
    refuse_gaps(log, signals)
    carried = Carried(None)
    if signals.torque is not None:
        fits["sensor"], carried = _fit_with_payload(arm, signals, signals.torque, behind_gears=True)
    if signals.command is not None and not fits:
        fits["losses"], carried = _fit_with_payload(arm, signals, signals.command, behind_gears=False)
    elif signals.command is not None:
        fits["losses"] = fit(arm, signals, signals.command, behind_gears=False, carried=carried.parameters(arm))
    refuse_contact(log, arm, next(iter(fits.values())))
    found = Identification(log, arm, _calibration(log, arm, signals, fits, carried), fits, signals, carried)
    if not found.fits_already and not found.reduction >= 1.0 - _WORSE:  # NaN as well
        worse = f"{-found.reduction:.0%} larger" if np.isfinite(found.reduction) else "no number"
        raise InvalidInputError(
            f"{log.source}: what its first half shows makes the residual of the second {worse}; "
            "record a longer motion in which every joint moves to and fro, see `contactsafe record`"
        )
    return found


def _fit_with_payload(arm: Arm, signals: Signals, torque: np.ndarray, behind_gears: bool) -> tuple[Fit, Carried]:
    """Return the fit of one torque with the payload that the file will hold, whatever else a fit might assume."""
    found = fit(arm, signals, torque, behind_gears)
    carried = carried_by(found, arm)
    if carried.left_out:
        found = fit(arm, signals, torque, behind_gears, carried.parameters(arm))
    return found, carried


def _calibration(log: Log, arm: Arm, signals: Signals, fits: dict[str, Fit], carried: Carried) -> Calibration:
    losses, sensor = fits.get("losses"), fits.get("sensor")
    stiction = np.full(arm.n, np.nan) if losses is None else breakaway_torque(arm, signals, losses)
    return Calibration(
        robot=arm.name,
        tool=tool_name(arm),
        torque_noise=signals.torque_noise,
        velocity_noise=signals.velocity_noise,
        stiction=stiction,
        losses=None if losses is None else losses.losses(),
        rotor=None if losses is None else np.maximum(losses.of("rotor"), 0.0),
        sensor=None if sensor is None else sensor.losses(),
        payload=carried.payload,
        source=log.source,
    )


def _second(values: np.ndarray) -> np.ndarray:
    return values[len(values) // 2 :]


def _rms(residual: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return the size of each joint's residual in the windows that count, (n,); NaN where none does."""
    many = counts.sum(axis=0)
    squares = np.sum(np.where(counts, residual**2, 0.0), axis=0)
    return np.sqrt(np.where(many > 0, squares, np.nan) / np.maximum(many, 1))
