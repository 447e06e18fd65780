"""All processes of a run: started, told to begin once all are ready, followed, and seen off."""

import math
import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from typing import Any

import numpy as np

from contactsafe.core.errors import ContactSafeError
from contactsafe.core.process import TERMINAL_SIGNALS
from contactsafe.hardware.ending import Ending, ending_of
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.states import ASKED, POLICY_DEAD

_READY_S = 1800.0
"""The first run on a machine compiles for minutes."""

_SEE_OFF_S = 12.0
"""After so long whoever has not ended is ended."""

_EVERY_S = 0.05


class RunError(ContactSafeError):
    """A run did not come about."""


@dataclass(frozen=True)
class Part:
    """A process of a run.

    Attributes:
        name: "control", "policy", "recorder" or "watchdog".
        target: what it does; called with the path of the shared memory, then `arguments`.
        arguments: that can be pickled.
    """

    name: str
    target: Callable[..., None]
    arguments: tuple[Any, ...] = ()


def run_crew(
    exchange: Exchange, parts: list[Part], seconds: float, on_look: Callable[[np.void], None] | None = None
) -> Ending:
    """Run all processes until the work is done, the time is up, Ctrl-C, or something goes wrong.

    Args:
        exchange: of the run; it is gone afterwards.
        parts: the processes; all but control and watchdog may be left out.
        seconds: for which it runs at most, by the robot's ticks; inf for no end.
        on_look: called some twenty times a second with the run's status.

    Raises:
        RunError: a process ended before the run could begin.
    """
    context, status = multiprocessing.get_context("spawn"), exchange.status
    processes = {
        part.name: context.Process(target=part.target, args=(str(exchange.path), *part.arguments)) for part in parts
    }
    started: list[BaseProcess] = []
    try:
        for process in processes.values():
            process.start()
            started.append(process)
        _wait_until_ready(processes, exchange)
        status["last_tick"] = round(1000.0 * seconds) if math.isfinite(seconds) else 0
        status["go"] = 1
        with _asked_by_signal(exchange):
            while processes["control"].is_alive() and not status["finished"][0]:
                status["beat_command"] += 1
                if on_look:
                    on_look(status[0])
                time.sleep(_EVERY_S)
    finally:
        exchange.ask_to_stop(ASKED)
        _see_off(started, exchange)
        exchange.unlink()
    return ending_of(exchange)


def _wait_until_ready(processes: Mapping[str, BaseProcess], exchange: Exchange) -> None:
    """Wait until control and policy have compiled, loaded and opened what they need."""
    status, until = exchange.status, time.monotonic() + _READY_S
    awaited = [name for name in ("control", "policy", "watchdog") if name in processes]
    while not all(status[f"beat_{name}"][0] for name in awaited):
        status["beat_command"] += 1
        gone = [name for name in processes if not processes[name].is_alive()]
        if gone or time.monotonic() > until:
            status["finished"] = 1
            first = "policy" if status["stop"][0] == POLICY_DEAD else (*gone, *awaited)[0]  # others end for its sake
            raise RunError(f"the {first} process did not get ready; it said why above")
        time.sleep(_EVERY_S)


@contextmanager
def _asked_by_signal(exchange: Exchange) -> Iterator[None]:
    """Bring the arm to rest on Ctrl-C, SIGTERM, and where the terminal is closed, instead of dying of them."""

    def ask(*_: Any) -> None:
        exchange.ask_to_stop(ASKED)

    before = {number: signal.signal(number, ask) for number in (*TERMINAL_SIGNALS, signal.SIGTERM)}
    for number, handler in before.items():
        if handler is signal.SIG_IGN and number not in (signal.SIGINT, signal.SIGTERM):  # as nohup wants it
            signal.signal(number, handler)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _see_off(processes: Sequence[BaseProcess], exchange: Exchange) -> None:
    """Wait for all to end; the watchdog ends whoever does not, and this does where there is none."""
    until = time.monotonic() + _SEE_OFF_S
    while any(process.is_alive() for process in processes) and time.monotonic() < until:
        exchange.status["beat_command"] += 1
        time.sleep(_EVERY_S)
    for process in processes:
        if process.is_alive():
            process.kill()
        process.join(1.0)
