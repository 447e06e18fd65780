"""Identification: what of a robot is other than its description says, from a log of free motion."""

from dataclasses import dataclass

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.logs.fitting import Fit, fit
from contactsafe.logs.log import Log
from contactsafe.logs.smoothing import Signals, signals_of
from contactsafe.logs.soundness import refuse_contact, refuse_gaps, refuse_unfit
from contactsafe.logs.stiction import breakaway_torque
from contactsafe.robot.arm import Arm, require_arm
from contactsafe.robot.calibrated import can_carry, tool_name
from contactsafe.robot.calibration import Calibration
from contactsafe.robot.payload import Payload
from contactsafe.robot.regressor import site_in_link

_SURE = 3.0
"""Standard deviations by which a payload's mass must be other than zero."""

_SHOWN = 0.5
"""Fraction of what was not known beforehand that may be left of an unknown which the log shows."""

_WORSE = 1.02
_NOTHING = 5e-4
"""A residual of this fraction of the torque limit is none."""

_FAR_M = 1.0


@dataclass(frozen=True)
class Identification:
    """What was identified, and how well it predicts what it was not identified from.

    Attributes:
        log: of the robot.
        arm: by its description.
        calibration: what was found, from the whole log.
        fits: 'sensor' from torque measured behind the gears, 'losses' from commands; one or both.
        signals: of the log.
    """

    log: Log
    arm: Arm
    calibration: Calibration
    fits: dict[str, Fit]
    signals: Signals

    @property
    def fit(self) -> Fit:
        """The fit of the torque that the estimator goes by: the measured one, if any."""
        return next(iter(self.fits.values()))

    @property
    def before(self) -> np.ndarray:
        """Residual of the second half by the arm's description, rms, (n,), N m."""
        return _rms(_second(self.fit.nominal))

    @property
    def after(self) -> np.ndarray:
        """Residual of the second half by what the first half shows, rms, (n,), N m."""
        return _rms(_second(self.fit.check))

    @property
    def reduction(self) -> float:
        """By which fraction the residual of the second half, rms over all joints, is smaller."""
        before = float(np.sqrt(np.sum(self.before**2)))
        return 1.0 - float(np.sqrt(np.sum(self.after**2))) / before if before > 0.0 else 0.0

    @property
    def fits_already(self) -> bool:
        """Whether the description leaves next to nothing."""
        return bool((self.before < _NOTHING * self.arm.tau_max).all())

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
        before, after = (float(np.sqrt(np.mean(part**2))) for part in (self.before, self.after))
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
    signals, fits = signals_of(log), {}
    refuse_gaps(log, signals)
    carried = None
    if signals.torque is not None:
        fits["sensor"] = fit(arm, signals, signals.torque, behind_gears=True)
        carried = fits["sensor"].load()
    if signals.command is not None:
        fits["losses"] = fit(arm, signals, signals.command, behind_gears=False, carried=carried)
    refuse_contact(log, arm, next(iter(fits.values())))
    found = Identification(log, arm, _calibration(log, arm, signals, fits), fits, signals)
    if not found.fits_already and not found.reduction >= 1.0 - _WORSE:  # NaN as well
        raise InvalidInputError(
            f"{log.source}: what its first half shows makes the residual of the second {-found.reduction:.0%} larger; "
            "record a longer motion in which every joint moves to and fro, see `contactsafe record`"
        )
    return found


def _calibration(log: Log, arm: Arm, signals: Signals, fits: dict[str, Fit]) -> Calibration:
    losses, sensor = fits.get("losses"), fits.get("sensor")
    payload = payload_of(next(iter(fits.values())), arm)
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
        payload=payload,
        source=log.source,
    )


def payload_of(found: Fit, arm: Arm) -> Payload | None:
    """Return the payload that a fit shows, in the tool's frame; None where there is none to speak of."""
    if not found.unknowns.load:
        return None
    mass, moment, tensor = np.split(found.of("load"), [1, 4])
    kg = float(mass[0])
    if abs(kg) < _SURE * float(found.deviation("load")[0]):
        return None
    R, origin = site_in_link(arm)
    at = moment / kg
    com = R.T @ (at - origin)
    xx, yy, zz, xy, xz, yz = tensor
    about_frame = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inertia = R.T @ (about_frame - kg * (at @ at * np.eye(3) - np.outer(at, at))) @ R
    if np.linalg.norm(com) > _FAR_M:
        return None
    for one in (Payload(kg, com, inertia), Payload(kg, com, np.zeros((3, 3)))):
        if can_carry(arm, one) and (kg < 0.0 or np.linalg.eigvalsh(one.inertia)[0] >= 0.0):
            return one
    return None


def _second(residual: np.ndarray) -> np.ndarray:
    return residual[len(residual) // 2 :]


def _rms(residual: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(residual**2, axis=0))
