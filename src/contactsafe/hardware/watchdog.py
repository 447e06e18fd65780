"""The watchdog: it waits for nobody, so it can tell when another process has died or stands still."""

import contextlib
import os
import signal
import time

from contactsafe.core.copying import Unique
from contactsafe.core.process import ignore_terminal
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.states import (
    COMMAND_DEAD,
    CONTROL_DEAD,
    CONTROL_STUCK,
    FAULT,
    HELD,
    POLICY_DEAD,
    ROBOT_SILENT,
    RUNNING,
    STOPPING,
)

_EVERY_S = 0.01
_STUCK_S, _SILENT_S = 0.1, 0.3
"""The control loop stands still after so long without a beat, or the robot is silent."""

_COMMAND_S, _FIRST_S = 2.0, 120.0
"""The command that began the run is gone after so long without a beat, or without a first one: each process that it
starts reads whatever the user's program imports."""

_LET_GO_S, _END_S = 5.0, 3.0
"""A control process that does not let go of the robot within the first is ended, and the others, once that is done,
within the second."""

_OTHERS = ("policy", "recorder")


class _Beats:
    """When each process last showed that it lives."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[int, float]] = {}

    def silent_for(self, name: str, beat: int) -> float:
        """Return for how long a beat has not changed, s."""
        now = time.monotonic()
        if self._last.get(name, (None, 0.0))[0] != beat:
            self._last[name] = (beat, now)
        return now - self._last[name][1]


class Watchdog(Unique):
    """Watches one run.

    Args:
        exchange: of the run.
    """

    _why = "a watchdog holds handles of processes; make another one"

    def __init__(self, exchange: Exchange):
        self.exchange, self._beats = exchange, _Beats()
        self._handles: dict[str, int] = {}
        self._asked_at = self._finished_at = 0.0

    def look(self) -> bool:
        """Look once at all; return whether the run is over and everybody gone."""
        status, now = self.exchange.status, time.monotonic()
        status["beat_watchdog"] += 1
        self._adopt()
        beat = int(status["beat_command"][0])
        if self._beats.silent_for("command", beat) > (_COMMAND_S if beat else _FIRST_S):
            self.exchange.ask_to_stop(COMMAND_DEAD)
        if self._is_dead("policy") and not status["finished"][0]:
            self.exchange.ask_to_stop(POLICY_DEAD)
        self._look_at_control()
        if status["stop"][0]:
            self._asked_at = self._asked_at or now
            if not status["finished"][0] and now - self._asked_at > _LET_GO_S:
                self._end("control")
        if not status["finished"][0]:
            return False
        self._finished_at = self._finished_at or now
        if all(self._is_dead(name) for name in ("control", *_OTHERS)):
            return True
        if now - self._finished_at > _END_S:
            for name in ("control", *_OTHERS):
                self._end(name)
        return False

    def _look_at_control(self) -> None:
        status = self.exchange.status
        if self._is_dead("control"):
            if not status["finished"][0]:
                self.exchange.ask_to_stop(CONTROL_DEAD)
                status["state"], status["reason"], status["finished"] = FAULT, CONTROL_DEAD, 1
            return
        turns = status["state"][0] in (RUNNING, HELD, STOPPING, FAULT) and not status["lockstep"][0]
        waits = bool(status["waits_for_robot"][0])
        silent = self._beats.silent_for("control", int(status["beat_control"][0]))  # after: it beats before it turns
        if turns and not status["finished"][0] and silent > (_SILENT_S if waits else _STUCK_S):
            self.exchange.ask_to_stop(ROBOT_SILENT if waits else CONTROL_STUCK)

    def _adopt(self) -> None:
        """Get hold of the processes that have come, by handles that no other process can take over."""
        status = self.exchange.status
        for name in ("control", *_OTHERS):
            pid = int(status[f"pid_{name}"][0])
            if pid and name not in self._handles:
                with contextlib.suppress(OSError):
                    self._handles[name] = os.pidfd_open(pid)

    def _is_dead(self, name: str) -> bool:
        """Tell whether a process that was there is gone; one that never came counts as gone once all is over."""
        handle = self._handles.get(name)
        if handle is None:
            return bool(self.exchange.status["finished"][0])
        try:
            signal.pidfd_send_signal(handle, 0)
        except ProcessLookupError:
            return True
        return _is_zombie(int(self.exchange.status[f"pid_{name}"][0]))

    def _end(self, name: str) -> None:
        with contextlib.suppress(OSError, KeyError):
            signal.pidfd_send_signal(self._handles[name], signal.SIGKILL)


def _is_zombie(pid: int) -> bool:
    """Tell whether a process has ended and only its parent has not noticed."""
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


def watch(exchange_path: str) -> None:
    """Be the watchdog of a run, until everybody else is gone; the last one out removes the shared memory."""
    ignore_terminal()
    exchange = Exchange(exchange_path)
    exchange.status["pid_watchdog"] = os.getpid()
    dog = Watchdog(exchange)
    while not dog.look():
        time.sleep(_EVERY_S)
    exchange.unlink()
