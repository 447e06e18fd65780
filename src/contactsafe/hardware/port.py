"""The few functions that stand between the control process and a robot."""

from typing import Protocol

import numpy as np

from contactsafe.core.errors import ContactSafeError


class RobotError(ContactSafeError):
    """The robot has stopped by itself, cannot be reached, or refuses.

    Args:
        names: of its errors, as the robot calls them.
        detail: what its library said.
    """

    def __init__(self, names: tuple[str, ...], detail: str):
        super().__init__(f"{', '.join(names) or 'robot error'}: {detail}")
        self.names, self.detail = names, detail


class RobotSilentError(RobotError):
    """Nothing comes from the robot any more, or it cannot be reached."""


class RobotPort(Protocol):
    """A torque-controlled robot of one kind.

    Torques are without gravity, which these robots add; a reading has it in the torque measured.
    """

    torque_rate: np.ndarray
    """Most that the robot lets each joint's torque change in a tick, (n,), N m."""

    arrived_ns: int
    """When the state that was read last came, by `time.perf_counter_ns`: what is done with it counts from here."""

    def connect(self) -> None:
        """Reach the robot and prepare it; it does not move. Raises `RobotError`."""
        ...

    def recover(self) -> None:
        """Acknowledge what stopped the robot, so that it can be controlled again; it does not move."""
        ...

    def look(self, reading: np.ndarray) -> None:
        """Fill a reading of a robot that is not controlled; `reading_dtype`, one record."""
        ...

    def begin(self) -> None:
        """Take control; from now on `read` and `write` follow each other within a tick."""
        ...

    def read(self, reading: np.ndarray) -> int:
        """Wait for the next cycle and fill its reading; return how many milliseconds passed since the last."""
        ...

    def write(self, torque: np.ndarray) -> None:
        """Send joint torques, (n,), N m."""
        ...

    def finish(self) -> None:
        """Give control back: the robot holds itself."""
        ...

    def errors(self) -> tuple[str, ...]:
        """Return the errors that the robot reports now, as it calls them; none where it does not answer."""
        ...

    def close(self) -> None:
        """Let go of the connection."""
        ...
