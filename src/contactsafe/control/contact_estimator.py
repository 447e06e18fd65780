"""The estimator alone: what touches an arm that somebody else drives, live or from a log."""

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.control.checks import believable, shaped
from contactsafe.control.codes import FAULTS
from contactsafe.control.config import ControllerConfig, damping_rate
from contactsafe.control.damping import GAIN_MARGIN
from contactsafe.control.estimation import estimate_at
from contactsafe.control.instance import Instance, checked_config
from contactsafe.control.presets import safe
from contactsafe.control.signals import Contact, Measurement, contact_of
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm, require_arm
from contactsafe.robot.friction import joint_drag

RATES_HZ = (90.0, 2000.0)
"""Lowest and highest rate of measurements that the estimator is made for."""

_BELIEVED = 10.0
"""Multiple of a joint's torque limit beyond which no torque is one."""


class ContactEstimator(Instance):
    """Feels what touches an arm, with the compiled stages that the controller runs; a copy goes on by itself.

    Args:
        arm: `contactsafe.robots.panda()` or another.
        config: None for `safe()`; of a preset such as `contactsafe.presets.paper()` the laws are not used.
        dt: between two measurements, s.

    Attributes:
        record: everything the estimator is made of; copy its `state` to save it.

    Raises:
        InvalidInputError: no arm, no configuration, or a rate outside `RATES_HZ`.
    """

    def __init__(self, arm: Arm, config: ControllerConfig | None = None, dt: float = 0.001) -> None:
        super().__init__(require_arm(arm), _at_rate(checked_config(safe() if config is None else config), dt), None, 0)
        self.reset(np.clip(arm.home, arm.q_min, arm.q_max))
        self.step(Measurement(arm.home, np.zeros(arm.n), torque=np.zeros(arm.n)))  # compiles, or loads what was
        self.places()
        self._is_reset = False

    def reset(self, q: ArrayLike, qd: ArrayLike | None = None) -> None:
        """Forget everything; the arm is at q (n,) rad and moves with qd (n,) rad/s, by default not at all.

        Raises:
            InvalidInputError: a wrong shape, a number that is not finite, or velocities that the arm cannot have.
        """
        q = self.arm.joint_vector(q, "q")
        qd = self.arm.joint_vector(np.zeros(self.arm.n) if qd is None else qd, "qd")
        qd = believable(qd, self.record["params"]["arm"]["qd_most"])
        self.forget()
        self.record["dynamics"] = dynamics = self.arm.dynamics(q, qd)
        state = self.record["state"]
        state["command"]["tau"], state["clock"]["q_good"] = dynamics["g"], q
        self.record["measurement"]["q"], self.record["measurement"]["qd"] = q, qd
        self._fault, self._is_reset = 0, True

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
        measurement = _whole(measurement, command)
        self.set_measurement(measurement)
        estimate_at(self._ticked, self._index)
        if self.record["state"]["clock"]["braking"]:
            self._begin_anew(measurement)
        self._drive(sent, measurement.torque is not None)
        return contact_of(self._reported)

    @property
    def fault(self) -> str:
        """'none', or the first reason since `reset` why a measurement was not believed."""
        return FAULTS[int(self.record["state"]["fault"] or self._fault)]

    def _begin_anew(self, measurement: Measurement) -> None:
        """Start where the arm is now: nothing was believed for so long that what was known is out of date."""
        fault = int(self._fault or self.record["state"]["fault"])
        self.reset(self.record["state"]["arm"]["q"])
        self._fault = fault
        self.set_measurement(measurement)
        estimate_at(self._ticked, self._index)

    def _drive(self, sent: np.ndarray, measured: bool) -> None:
        """Remember what drives the joints until the next measurement, and how much of it is friction."""
        believed = np.abs(sent) < _BELIEVED * self.arm.tau_max  # NaN is not
        if self.record["state"]["clock"]["bridged"] == 0 and believed.all():
            state, expects = self.record["state"], self.config.impedance.friction_compensation and not measured
            state["command"]["tau"] = sent
            drag = joint_drag(self.arm.friction, self.arm.drag, state["arm"]["qd"]) if expects else 0.0
            state["command"]["friction"] = drag


def _whole(measurement: Measurement, command: ArrayLike | None) -> Measurement:
    """Return a measurement without a sensor that is broken; positions and velocities are the tick's to refuse."""
    wrench, torque, base = measurement.wrench_ee, measurement.torque, measurement.wrench_base
    if wrench is not None and not np.isfinite(wrench).all():
        measurement = measurement._replace(wrench_ee=None)
    if base is not None and not np.isfinite(shaped(base, 6, "wrench_base")).all():
        measurement = measurement._replace(wrench_base=None)
    if torque is not None and command is not None and not np.isfinite(torque).all():
        measurement = measurement._replace(torque=None)
    return measurement


def _at_rate(config: ControllerConfig, dt: float) -> ControllerConfig:
    """Return a configuration at another rate; the damping of the laws is none that this rate makes unstable."""
    low, high = RATES_HZ
    if not isinstance(dt, int | float) or not 1.0 / high <= dt <= 1.001 / low:
        raise InvalidInputError(f"dt = {dt!r} s; give {1.0 / high:g} to {1.0 / low:.3g} s, {low:g} to {high:g} Hz")
    slow = config.with_(damping_range=(1e-6, 1e-5), dt=float(dt))
    highest = damping_rate(slow, GAIN_MARGIN)
    return slow.with_(damping_range=(0.01 * highest, 0.5 * highest))
