"""One `controller_dtype` record with its arm: what all that steps such a record has in common."""

from typing import ClassVar

import numpy as np

from contactsafe.control.checks import checked_slot, seconds, shaped
from contactsafe.control.config import ControllerConfig
from contactsafe.control.params import fill_params
from contactsafe.control.places import Place, places_of
from contactsafe.control.presets import safe
from contactsafe.control.records import controller_dtype
from contactsafe.control.signals import Measurement
from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm


class Instance(Independent):
    """A record that compiled code steps. A copy, pickled or not, goes on by itself from where this one is.

    Args:
        arm: whose record it is.
        config: resolved for it.
        records: `controller_dtype` records to live in; its own where None.
        index: which of them.

    Attributes:
        record: everything it is made of; copy its `state` to save it.
    """

    _bound: ClassVar[tuple[str, ...]] = ("record", "_ticked", "_measured", "_reported")

    def __init__(self, arm: Arm, config: ControllerConfig, records: np.ndarray | None, index: int) -> None:
        self.arm = arm
        self.config = config
        self._nominal = arm.nominal()
        self._records, self._index = checked_slot(arm, records, index)
        self._bind()
        fill_params(self.record["params"], config, arm)
        self._is_reset = False

    def _bind(self) -> None:
        self.record = self._records[self._index]
        self._ticked = self._records.view(controller_dtype(self.arm.n))  # what was pickled has an equal type of its own
        self._measured = views(self._records["measurement"], self._index)
        self._reported = views(self._records["output"], self._index)
        self.record["handle"] = self._nominal.handle

    def forget(self) -> None:
        """Clear what was measured, remembered and reported."""
        for part in ("state", "output", "measurement"):
            self.record[part] = np.zeros((), dtype=self.record[part].dtype)

    def places(self, fraction: float = 0.95) -> list[Place]:
        """Return where the present contact may be: the places that together have a fraction of the probability.

        Joint torques alone cannot tell some places apart; the set shrinks as the arm moves on in contact.

        Args:
            fraction: of the probability, 0 … 1.

        Returns:
            Likeliest first; empty where nothing shows in the joints.

        Raises:
            InvalidInputError: that is no fraction.
        """
        return places_of(self._ticked, self._index, fraction)

    def require_reset(self, measurement: Measurement) -> None:
        """Refuse what is no measurement, and one that comes before a reset.

        Raises:
            InvalidInputError: as it says.
        """
        if not isinstance(measurement, Measurement):
            raise InvalidInputError(f"measurement is {type(measurement).__name__}; give a contactsafe.Measurement")
        if not self._is_reset:
            raise InvalidInputError(
                f"the {type(self).__name__.removeprefix('Contact').lower()} was not reset; "
                "call reset(q) with the measured joint positions first"
            )

    def set_measurement(self, measurement: Measurement) -> None:
        """Check a measurement's shapes and write it into the record; its numbers are the tick's to refuse.

        Raises:
            InvalidInputError: wrong shapes, or what are no numbers.
        """
        seen = self._measured
        seen["q"][:] = shaped(measurement.q, self.arm.n, "q")
        seen["qd"][:] = shaped(measurement.qd, self.arm.n, "qd")
        seen["has_wrench"][...] = measurement.wrench_ee is not None
        if measurement.wrench_ee is not None:
            seen["wrench_ee"][:] = shaped(measurement.wrench_ee, 6, "wrench_ee")
        seen["has_torque"][...] = measurement.torque is not None
        if measurement.torque is not None:
            seen["torque"][:] = shaped(measurement.torque, self.arm.n, "torque")
        seen["has_time"][...] = measurement.time is not None
        if measurement.time is not None:
            seen["time"][...] = seconds(measurement.time)


def checked_config(config: ControllerConfig | None) -> ControllerConfig:
    """Return a configuration as it was given, or the default.

    Raises:
        InvalidInputError: it is none.
    """
    config = safe() if config is None else config
    if not isinstance(config, ControllerConfig):
        raise InvalidInputError(
            f"config is {type(config).__name__}; give a ControllerConfig such as contactsafe.presets.safe()"
        )
    return config


def views(records: np.ndarray, index: int) -> dict[str, np.ndarray]:
    """Return each field of one record as an array on its memory: reading and writing it is quick."""
    return {
        name: records[name][index : index + 1].reshape(records.dtype[name].shape) for name in records.dtype.names or ()
    }
