"""Progress of the long commands: a bar in a terminal, a line now and then elsewhere."""

import contextlib
import sys
import time
from collections.abc import Iterable
from typing import Any

from tqdm import tqdm

LINE_EVERY_S = 30.0
"""Time from one line to the next where stderr is no terminal, s."""


def progress_bar(iterable: Iterable | None = None, **options: Any) -> tqdm:
    """Begin to show progress on stderr: as tqdm does in a terminal, as lines in a log file.

    Args:
        iterable: to go through; None where `update` is called.
        options: of `tqdm`, such as `total`, `desc` and `unit`.
    """
    kind = tqdm if sys.stderr.isatty() else _Lines
    return kind(iterable, file=sys.stderr, **options)


class _Lines(tqdm):
    """Progress as whole lines, at most one every `LINE_EVERY_S`, and one at the end: no carriage return."""

    def __init__(self, iterable: Iterable | None, **options: Any):
        self._shown_s = time.monotonic()
        super().__init__(iterable, leave=False, position=0, **options)

    def display(self, msg: str | None = None, pos: int | None = None) -> None:
        """Write a line if it is time; `msg` and `pos` are of a bar on a screen."""
        if msg is None and time.monotonic() - self._shown_s >= LINE_EVERY_S:
            self._write()

    def close(self) -> None:
        """Write the last line."""
        if not getattr(self, "disable", True):
            with contextlib.suppress(ValueError):  # the stream is closed
                self._write()
        super().close()

    def _write(self) -> None:
        self._shown_s = time.monotonic()
        self.fp.write(f"{self}\n")
        self.fp.flush()
