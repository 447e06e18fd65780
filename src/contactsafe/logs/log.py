"""A log: what a robot recorded of its joints, checked."""

from dataclasses import dataclass, fields

import numpy as np

from contactsafe.core.errors import InvalidInputError

LEAST_ROWS = 50
"""A shorter log says nothing."""

_SECONDS = 60.0
"""Longest time between two rows that is one, s; more is another unit."""


@dataclass(frozen=True)
class Log:
    """What a robot recorded, one row a measurement.

    Attributes:
        source: where it comes from, for messages.
        time: (T,), s, ascending.
        q: joint positions, (T, n), rad.
        qd: joint velocities, (T, n), rad/s; None where they were not recorded.
        torque: joint torque measured behind the gears, gravity included, (T, n), N m; None likewise.
        command: joint torque commanded, gravity included, (T, n), N m; None likewise.
        wrench_ee: wrench of the environment on the end effector, world axes, (T, 6), N and N m; None likewise.
        wrench_base: wrench of the arm on its base, weight and all, as of `Measurement`, (T, 6), N and N m; None
            likewise.

    Raises:
        InvalidInputError: too few rows, another number of them or of columns, a number that is not finite, a time that
            does not go on, or neither torque nor command.
    """

    source: str
    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray | None = None
    torque: np.ndarray | None = None
    command: np.ndarray | None = None
    wrench_ee: np.ndarray | None = None
    wrench_base: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Refuse what no robot recorded."""
        if len(self.time) < LEAST_ROWS:
            raise InvalidInputError(f"{self.source} has {len(self.time)} rows; give at least {LEAST_ROWS}")
        if self.q.ndim != 2:
            raise InvalidInputError(f"{self.source}: 'q' has shape {self.q.shape}; give (T, n)")
        n = int(self.q.shape[1])
        for field in fields(self)[1:]:
            self._check(field.name, {"time": 0, "wrench_ee": 6, "wrench_base": 6}.get(field.name, n))
        if self.torque is None and self.command is None:
            raise InvalidInputError(
                f"{self.source} has neither 'torque' nor 'command'; one of them must say what drives the joints"
            )
        steps = np.diff(self.time)
        if (steps <= 0.0).any():
            row = int(np.argmax(steps <= 0.0)) + 1
            raise InvalidInputError(f"{self.source}: time does not go on at row {row}; leave out rows that repeat")
        if np.median(steps) > _SECONDS:
            raise InvalidInputError(f"{self.source}: time steps by {np.median(steps):g}; give it in seconds")

    def _check(self, name: str, columns: int) -> None:
        values = getattr(self, name)
        if values is None:
            return
        expected = (len(self.time), columns) if columns else (len(self.time),)
        if values.shape != expected:
            raise InvalidInputError(f"{self.source}: '{name}' has shape {values.shape}; give {expected}")
        bad = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
        if bad.any():
            raise InvalidInputError(
                f"{self.source}: '{name}' is not finite in {bad.sum()} rows, first in row {int(np.argmax(bad))}; "
                "leave those rows out"
            )

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    @property
    def step_s(self) -> float:
        """Time between two rows, the usual one, s."""
        return float(np.median(np.diff(self.time)))

    @property
    def seconds(self) -> float:
        """How long it lasts, s."""
        return float(self.time[-1] - self.time[0])
