"""Whether anybody is left who would end a run: command and watchdog beat for as long as they live."""

import time

import numpy as np

from contactsafe.core.copying import Unique

_ALONE_S = 3.0


class Heartbeats(Unique):
    """The two of them, as one of the other processes hears them.

    Args:
        status: of the run, one record.
    """

    _why = "it counts seconds since it was made; make another one"

    def __init__(self, status: np.ndarray):
        self._status, self._beats, self._heard = status, (-1, -1), time.monotonic()

    def have_stopped(self) -> bool:
        """Tell whether neither has been heard for three seconds."""
        beats = int(self._status["beat_watchdog"][0]), int(self._status["beat_command"][0])
        if beats != self._beats:
            self._beats, self._heard = beats, time.monotonic()
        return time.monotonic() - self._heard > _ALONE_S
