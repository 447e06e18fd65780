"""Priority, processor and memory of the control process, as far as the system grants them."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

_MCL_CURRENT, _MCL_FUTURE = 1, 2


@dataclass(frozen=True)
class Realtime:
    """What the control process asks the system for.

    Attributes:
        priority: of SCHED_FIFO, 1 … 99; 0 for none.
        cpu: processor that it keeps to; −1 for any.
        lock_memory: none of its pages is to be swapped out.
    """

    priority: int = 80
    cpu: int = -1
    lock_memory: bool = True


def apply(wanted: Realtime) -> list[str]:
    """Ask for it; return a line for all that was not granted, none where all was."""
    refused = []
    if wanted.priority > 0 and not _granted(
        lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(wanted.priority))
    ):
        refused.append(f"priority {wanted.priority} of SCHED_FIFO")
    if wanted.cpu >= 0 and not _granted(lambda: os.sched_setaffinity(0, {wanted.cpu})):
        refused.append(f"processor {wanted.cpu}")
    if wanted.lock_memory and not _granted(_lock_memory):
        refused.append("locked memory")
    if not refused:
        return []
    return [
        f"control: the system does not grant {', '.join(refused)}; ticks may come late under load (see the how-to of "
        "real robots)"
    ]


@contextmanager
def kept() -> Iterator[None]:
    """Keep this thread's priority as it is: libfranka takes the highest, and child processes inherit it."""
    policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, priority)


def _lock_memory() -> None:
    library = ctypes.CDLL(None, use_errno=True)
    if library.mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        raise OSError(ctypes.get_errno(), "mlockall")


def _granted(ask) -> bool:
    try:
        ask()
    except (OSError, ValueError):
        return False
    return True
