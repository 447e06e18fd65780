"""What belongs to one process: addresses, views of memory, native objects, threads. A copy makes its own.

State is data and can be copied; what points to it cannot. So an object keeps the two apart, and whether it is copied,
pickled or forked makes no difference: the data go along, and what points is made anew where they arrive.
"""

import copy
import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, ClassVar, NoReturn, Self

from contactsafe.core.errors import InvalidInputError


class Independent:
    """An object whose copies are apart from it, be they shallow, deep or pickled, and go on from where it is.

    Subclasses name in `_bound` the attributes that are worth nothing elsewhere and make them in `_bind`, which their
    constructor calls as its last act and every copy as its first.
    """

    _bound: ClassVar[tuple[str, ...]] = ()

    def _bind(self) -> None:
        """Make what `_bound` names, from all other attributes."""

    def __copy__(self) -> Self:
        return copy.deepcopy(self)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in self._bound}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()


class Unique:
    """An object that cannot be copied, for it holds what there is but once; `_why` says what, and the remedy."""

    _why: ClassVar[str]

    def __copy__(self) -> NoReturn:
        raise InvalidInputError(self._why)

    def __reduce__(self) -> NoReturn:
        raise InvalidInputError(self._why)


class Threads(Independent):
    """Threads that divide work, started when they are first needed: in a copy, and in a forked process, anew.

    Args:
        count: how many.
    """

    _bound = ("_pool", "_process")

    def __init__(self, count: int):
        self.count = count
        self._bind()

    def _bind(self) -> None:
        self._pool: ThreadPoolExecutor | None = None
        self._process = 0

    def submit(self, run: Callable, *arguments: Any) -> Future:
        """Have one of them call run(*arguments)."""
        if self._pool is None or self._process != os.getpid():
            # Of a pool that was forked the threads are gone: what it is given waits for ever.
            self._pool, self._process = ThreadPoolExecutor(self.count), os.getpid()
        return self._pool.submit(run, *arguments)

    def close(self) -> None:
        """End them; the next work starts others."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown()
        self._pool = None


class OfTraining(Unique):
    """What a training session holds open."""

    _why = "what a training session holds open cannot be copied or pickled; go on from its checkpoint, with --resume"
