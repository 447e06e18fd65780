"""The shared memory of a run: mailboxes, heartbeats and the recorder's rings, in one file in /dev/shm.

Whoever opens it maps the same bytes; every number has one writer. The file is unlinked by the watchdog, and by the
command where that has died.
"""

import contextlib
import mmap
import os
import tempfile
from pathlib import Path

import numpy as np

from contactsafe.core.copying import Unique
from contactsafe.core.errors import InvalidInputError, OutputError
from contactsafe.hardware.messages import message_dtype, row_dtype, seen_dtype, step_dtype
from contactsafe.hardware.status import status_dtype

FOLDER = Path("/dev/shm")
PREFIX = "contactsafe-run-"

TICKS, STEPS = 8192, 1024
"""Rows that the rings hold: eight seconds of ticks, seventeen of policy steps."""


class Exchange(Unique):
    """One run's shared memory, mapped.

    Args:
        path: of the file; made by `create`.

    Attributes:
        status: `status_dtype` record of heartbeats, states and figures.
        targets, seen: mailboxes, int64 words.
        ticks, steps: rings of `row_dtype` and `step_dtype` records.
    """

    _why = "a run's shared memory is mapped once a process; open its path where it is needed"

    def __init__(self, path: Path | str):
        self.path = Path(path)
        try:
            with open(self.path, "r+b") as file:
                self._map = mmap.mmap(file.fileno(), 0)
        except (OSError, ValueError) as error:
            raise InvalidInputError(f"{self.path} is no run's shared memory ({error}); start the run anew") from None
        self.status = np.frombuffer(self._map, status_dtype, 1)
        n = int(self.status["joints"][0])
        offsets = _offsets(n)
        self.targets = self._words(offsets["targets"], message_dtype(n))
        self.seen = self._words(offsets["seen"], seen_dtype(n))
        self.ticks = np.frombuffer(self._map, row_dtype(n), TICKS, offsets["ticks"])
        self.steps = np.frombuffer(self._map, step_dtype(), STEPS, offsets["steps"])

    def _words(self, offset: int, message: np.dtype) -> np.ndarray:
        return np.frombuffer(self._map, np.int64, 1 + message.itemsize // 8, offset)

    @property
    def joints(self) -> int:
        """Of the arm."""
        return int(self.status["joints"][0])

    def ask_to_stop(self, reason: int) -> None:
        """Have the control process bring the arm to rest; the first reason stays."""
        if self.status["stop"][0] == 0:
            self.status["stop"][0] = reason

    @classmethod
    def create(cls, n: int) -> "Exchange":
        """Make the shared memory of a run for an arm of n joints.

        Raises:
            OutputError: there is no room for it.
        """
        size = _offsets(n)["end"]
        try:
            handle, name = tempfile.mkstemp(prefix=f"{PREFIX}{os.getpid()}-", dir=FOLDER)
        except OSError as error:
            raise OutputError(f"{FOLDER} takes no file ({error.strerror}); a run needs {size >> 20} MB there") from None
        path = Path(name)
        try:
            os.posix_fallocate(handle, 0, size)
            os.pwrite(handle, np.array([n], np.int64).tobytes(), status_dtype.fields["joints"][1])  # type: ignore[index]
        except OSError as error:
            os.unlink(path)
            raise OutputError(f"{path}: {error.strerror}; a run needs {size >> 20} MB there") from None
        finally:
            os.close(handle)
        return cls(path)

    def unlink(self) -> None:
        """Remove the file; what is mapped stays until its processes end."""
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()


def _offsets(n: int) -> dict[str, int]:
    """Return where each part begins, bytes, on cache lines of their own."""
    parts = {
        "status": status_dtype.itemsize,
        "targets": 8 + message_dtype(n).itemsize,
        "seen": 8 + seen_dtype(n).itemsize,
        "ticks": TICKS * row_dtype(n).itemsize,
        "steps": STEPS * step_dtype().itemsize,
    }
    offsets, at = {}, 0
    for name, size in parts.items():
        offsets[name] = at
        at += -(-size // 64) * 64
    return offsets | {"end": at}
