"""The estimator alone: what touches an arm that somebody else drives, live or from a log."""

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.control.checks import believable, shaped
from contactsafe.control.config import ControllerConfig, damping_rate
from contactsafe.control.damping import GAIN_MARGIN
from contactsafe.control.estimation import estimate_at
from contactsafe.control.instance import Instance, checked_config
from contactsafe.control.presets import safe
from contactsafe.control.signals import Contact, Measurement, contact_of
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm, require_arm
from contactsafe.robot.friction import joint_friction

RATES_HZ = (90.0, 2000.0)
"""Lowest and highest rate of measurements that the estimator is made for."""


class ContactEstimator(Instance):
    """Feels what touches an arm, with the compiled stages that the controller runs, and drives nothing.

    A copy, pickled or not, goes on by itself from where this one is.

    Args:
        arm: `contactsafe.robots.panda()` or another.
        config: None for `sensitive()`; of a preset such as `contactsafe.presets.paper()` the laws are not used.
        dt: between two measurements, s.

    Attributes:
        record: everything the estimator is made of; copy its `state` to save it.

    Raises:
        InvalidInputError: no arm, no configuration, or a rate outside `RATES_HZ`.
    """

    def __init__(self, arm: Arm, config: ControllerConfig | None = None, dt: float = 0.001) -> None:
        super().__init__(
            require_arm(arm), _at_rate(checked_config(sensitive() if config is None else config), dt), None, 0
        )
        self.reset(np.clip(arm.home, arm.q_min, arm.q_max))
        self.step(Measurement(arm.home, np.zeros(arm.n), torque=np.zeros(arm.n)))  # compiles, or loads what was
        self._is_reset = False

    def reset(self, q: ArrayLike, qd: ArrayLike | None = None) -> None:
        """Forget everything; the arm is at q (n,) rad and moves with qd (n,) rad/s, by default not at all.

        Raises:
            InvalidInputError: a wrong shape, a number that is not finite, or more than the arm's joints can have.
        """
        q = self.arm.joint_vector(q, "q")
        qd = self.arm.joint_vector(np.zeros(self.arm.n) if qd is None else qd, "qd")
        qd = believable(qd, self.record["params"]["arm"]["qd_most"])
        self.forget()
        self.record["dynamics"] = dynamics = self.arm.dynamics(q, qd)
        state = self.record["state"]
        state["command"]["tau"], state["clock"]["q_good"] = dynamics["g"], q
        self._is_reset = True

    def step(self, measurement: Measurement, command: ArrayLike | None = None) -> Contact:
        """Take one measurement over and return what touches the arm.

        Args:
            measurement: of now.
            command: joint torque commanded from now on, gravity included, (n,), N m; None where the measurement has the
                torque itself.

        Raises:
            InvalidInputError: wrong shapes, or neither a command nor a measured torque.
        """
        self.require_reset(measurement)
        if command is None and measurement.torque is None:
            raise InvalidInputError(
                "neither measurement.torque nor a command was given; one of them must say what drives the joints"
            )
        sent = shaped(measurement.torque if command is None else command, self.arm.n, "command")
        self.set_measurement(measurement)
        estimate_at(self._ticked, self._index)
        if self.record["state"]["clock"]["braking"]:  # nothing was believed for so long that all begins anew
            self.reset(self.record["state"]["arm"]["q"])
            self.set_measurement(measurement)
            estimate_at(self._ticked, self._index)
        self._drive(sent, measurement.torque is not None)
        return contact_of(self._reported)

    def _drive(self, sent: np.ndarray, measured: bool) -> None:
        """Remember what drives the joints until the next measurement, and how much of it is friction."""
        if np.isfinite(sent).all():
            state, expects = self.record["state"], self.config.impedance.friction_compensation and not measured
            state["command"]["tau"] = sent
            state["command"]["friction"] = joint_friction(self.arm.friction, state["arm"]["qd"]) if expects else 0.0


def sensitive() -> ControllerConfig:
    """Return `presets.safe()` with what real signals need: the quieter of two velocities, noise that is filtered.

    A real Panda's own velocity signal has 4 to 6 mrad/s of noise between 5 and 50 Hz, which shows as contact; its
    positions are quiet. A tenth of δ is as much noise as does not delay detection.
    """
    return safe().with_(velocity_source="quieter", residual_noise_nm=0.15)


def _at_rate(config: ControllerConfig, dt: float) -> ControllerConfig:
    """Return a configuration at another rate; the damping of the laws is none that this rate makes unstable."""
    low, high = RATES_HZ
    if not isinstance(dt, int | float) or not 1.0 / high <= dt <= 1.001 / low:
        raise InvalidInputError(f"dt = {dt!r} s; give {1.0 / high:g} to {1.0 / low:.3g} s, {low:g} to {high:g} Hz")
    slow = config.with_(damping_range=(1e-6, 1e-5), dt=float(dt))
    highest = damping_rate(slow, GAIN_MARGIN)
    return slow.with_(damping_range=(0.01 * highest, 0.5 * highest))
