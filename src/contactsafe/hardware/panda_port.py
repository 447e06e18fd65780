"""The older Franka Panda, by the libfranka of panda-python, which speaks the protocol of its firmware.

Nobody here has tried it on a wire, and no simulator speaks that protocol: tests hold it against a library made up.
"""

import functools
import queue
import threading
import time
from typing import Any

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware.franka_port import FrankaPort, as_ours
from contactsafe.hardware.port import RobotSilentError

_SILENT_S = 1.0
_UNFILTERED_HZ = 1000.0
"""From this cut-off on libfranka does not filter the commands."""


@functools.cache
def _library() -> Any:
    try:
        from panda_py import libfranka
    except ImportError:
        raise InvalidInputError("panda-python is not installed; install contactsafe[panda]") from None
    return libfranka


class PandaPort(FrankaPort):
    """One Panda, by its address. Its library calls for each command, from a thread of its own.

    Args:
        address, load: as `FrankaPort` takes them.
    """

    def __init__(self, address: str, load: tuple[float, np.ndarray, np.ndarray] | None = None):
        super().__init__(address, load)
        self._thread: threading.Thread | None = None

    @property
    def _library(self) -> Any:
        return _library()

    def begin(self) -> None:
        """Take control; its time begins with the first state."""
        self._first_ms = None
        self._states: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._commands: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._move, daemon=True)
        self._thread.start()

    def _move(self) -> None:
        """Be called for each cycle until the motion ends, and hand on why it did."""
        try:
            self._robot.control(self._cycle, False, _UNFILTERED_HZ)
        except Exception as error:
            self._states.put(error)

    def _cycle(self, state: Any, passed: Any) -> Any:
        self._states.put((state, passed, time.perf_counter_ns()))
        return self._commands.get()

    def read(self, reading: np.ndarray) -> int:
        """Wait for the next state, a second at most; return the milliseconds since the last."""
        try:
            found = self._states.get(timeout=_SILENT_S)
        except queue.Empty:
            raise RobotSilentError((), f"no state for {_SILENT_S:g} s") from None
        if isinstance(found, Exception):
            raise as_ours(self._library, found) from None
        state, passed, self.arrived_ns = found
        self._fill(reading, state)
        return round(1000.0 * passed.to_sec())

    def write(self, torque: np.ndarray) -> None:
        """Send joint torques, (7,), N m, gravity not included."""
        self._commands.put(self._library.Torques(torque.tolist()))

    def finish(self) -> None:
        """End the motion: the robot holds itself."""
        self._commands.put(self._library.motion_finished(self._library.Torques([0.0] * 7)))
        if self._thread is not None:
            self._thread.join(_SILENT_S)
        self._thread = None

    def close(self) -> None:
        """Let go of the connection; a motion that runs is ended."""
        if self._thread is not None:
            self.finish()
        super().close()
