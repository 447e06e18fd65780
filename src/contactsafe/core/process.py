"""A command as a process among others: streams of any encoding that may break, signals that end it in one line.

The package imports this before anything slow, so that Ctrl-C during the imports of a command is told in one line too.
Standard library only.
"""

import contextlib
import io
import os
import select
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import PurePath

_SAID = {signal.SIGINT: "stopped", signal.SIGTERM: "terminated"}
TERMINAL_SIGNALS = (signal.SIGINT, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []))
"""By which a terminal ends all processes of a command: Ctrl-C, and as it is closed."""

_received: list[int] = []
_told: list[int] = []


def start() -> None:
    """Hear signals from now on where this process is the program, `contactsafe` or `python -m contactsafe`.

    Who imports the package into a program of their own keeps their signal handlers.
    """
    name = PurePath((getattr(sys, "argv", None) or [""])[0]).stem
    if name not in ("contactsafe", "-m"):  # "-m" while Python looks for the module to run
        return
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:  # closed: else the next file that is opened would be stdout, and take what is printed
            os.open(os.devnull, os.O_RDWR)
    _hear(_leave)


def run(command: Callable[[], int]) -> int:
    """Run a command with this process's streams and signals.

    Characters that an encoding has not are replaced. A reader that goes away ends the command quietly, a full disk with
    one line; what cannot be written to stderr is dropped, for no result goes there. A signal is raised in the command
    as KeyboardInterrupt, so that it tidies up; a second one ends it at once.

    Args:
        command: gives the exit status.

    Returns:
        The exit status: the command's; 1 where stdout cannot be written; 128 and the number of the signal, as shells
        have it, where one ended it (SIGPIPE's where the reader went away).
    """
    sys.stdout, sys.stderr = _stream(sys.stdout, 1, lossy=False), _stream(sys.stderr, 2, lossy=True)
    sys.unraisablehook = _unraisable
    _hear(_interrupt)
    try:
        status = command()
        sys.stdout.flush()
    except _LostError as lost:
        status = _status_without_stdout(lost.reason)
    except BaseException:
        if not _received:  # else it is Ctrl-C, whatever a library has made of it
            raise
        _tell(_received[0])
        status = 128 + _received[0]
    _hear(_leave)
    return status


def ignore_terminal() -> None:
    """Go on where the terminal says to stop, or to wait: the command hears it too, and ends its processes in order."""
    for number in (*TERMINAL_SIGNALS, *([signal.SIGTSTP] if hasattr(signal, "SIGTSTP") else [])):
        signal.signal(number, signal.SIG_IGN)


class _LostError(BaseException):
    """Standard output cannot be written. No `except Exception` in between is to take it for its own."""

    def __init__(self, reason: OSError):
        super().__init__(str(reason))
        self.reason = reason


class _Stopped(KeyboardInterrupt):
    """Ctrl-C. Of a class of its own, for where Python's has passed through `exec`, Python kills itself at its end."""


class _Outlet(io.FileIO):
    """What a stream writes to. Once it has failed, it takes everything and passes nothing on."""

    def __init__(self, number: int, lossy: bool):
        super().__init__(number, "w", closefd=False)
        self._lossy, self._failed = lossy, False

    def write(self, data) -> int:
        """Write bytes; wait where the other end does not block and is full."""
        while not self._failed:
            try:
                written = super().write(data)
                if written is not None:
                    return written
                select.select([], [self], [])
            except OSError as error:
                self._failed = True
                if not self._lossy:
                    raise _LostError(error) from None
        return len(data)


def _stream(stream, number: int, lossy: bool):
    """Give a stream that lives with what becomes of its other end, in place of Python's own."""
    if stream is None:  # closed
        return open(os.devnull, "w", encoding="utf-8")
    if stream not in (sys.__stdout__, sys.__stderr__):  # somebody's own
        return stream
    stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(_Outlet(number, lossy)),
        encoding=stream.encoding,
        errors="replace",
        line_buffering=lossy or stream.line_buffering,
        write_through=stream.write_through,
    )


def _status_without_stdout(reason: OSError) -> int:
    if isinstance(reason, BrokenPipeError):
        return 128 + signal.SIGPIPE
    _say(f"cannot write to standard output: {(reason.strerror or str(reason)).lower()}; give it another place")
    return 1


def _hear(handler: Callable) -> None:
    if threading.current_thread() is not threading.main_thread():
        return
    for number in _SAID:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup, or in a script's background
            signal.signal(number, handler)


def _interrupt(number: int, frame: object) -> None:
    """Let the command tidy up."""
    _received.append(number)
    _hear(_leave)
    raise _Stopped


def _leave(number: int, frame: object) -> None:
    """End at once: nothing has begun, everything is done, or somebody asks for the second time."""
    _tell(number)
    os._exit(128 + number)


def _unraisable(what) -> None:
    """End where a KeyboardInterrupt is raised in a callback that would swallow it; tell of other mishaps as usual."""
    if _received and issubclass(what.exc_type, KeyboardInterrupt):
        _leave(_received[0], None)
    sys.__unraisablehook__(what)


def _tell(number: int) -> None:
    if not _told:
        _told.append(number)
        _say(_SAID[signal.Signals(number)])


def _say(text: str) -> None:
    """Write a line to stderr, by the system's own call: a handler may run amidst another write."""
    with contextlib.suppress(OSError):
        os.write(2, f"contactsafe: {text}\n".encode("ascii", "replace"))


start()
