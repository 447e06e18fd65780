"""TensorBoard's log of a run, written at once: what is logged is on disk before the checkpoint that follows."""

import contextlib
import itertools
import os
import socket
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from stable_baselines3.common.logger import KVWriter
from tensorboard.compat.proto import event_pb2, summary_pb2
from tensorboard.summary.writer.record_writer import RecordWriter

from contactsafe.core.copying import OfTraining
from contactsafe.core.files import cannot_write


class EventFile(OfTraining):
    """TensorBoard's log of numbers, written at once and not by a thread: a full disk is told where it is met.

    Args:
        folder: of the run.
        hidden_from: step from which on the points of earlier files in the folder are hidden; None to hide none.

    Raises:
        OutputError: it cannot be written; this is true of `write` and `close` as well.
    """

    _number = itertools.count()

    def __init__(self, folder: Path | str, hidden_from: int | None = None):
        name = f"events.out.tfevents.{int(time.time())}.{socket.gethostname()}.{os.getpid()}.{next(self._number)}"
        self._path = Path(folder) / name
        with self._told():
            self._file = self._path.open("wb")
        self._writer = RecordWriter(self._file)
        self._add(file_version="brain.Event:2")
        if hidden_from is not None:
            self._add(step=hidden_from, session_log=event_pb2.SessionLog(status=event_pb2.SessionLog.START))

    def write(self, numbers: Mapping[str, Any], step: int) -> None:
        """Write numbers by name as the points of a step."""
        values = [summary_pb2.Summary.Value(tag=name, simple_value=value) for name, value in numbers.items()]
        self._add(step=step, summary=summary_pb2.Summary(value=values))

    def close(self) -> None:
        """Close the file."""
        with self._told():
            self._file.close()

    def _add(self, **event: Any) -> None:
        with self._told():
            self._writer.write(event_pb2.Event(wall_time=time.time(), **event).SerializeToString())
            self._file.flush()

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise cannot_write(self._path, error) from None


class Curves(OfTraining, KVWriter):
    """TensorBoard's log of a run; points that a killed session wrote after its last checkpoint are hidden.

    Args:
        folder: of the run.
        steps: at which the session begins.
    """

    def __init__(self, folder: Path | str, steps: int):
        _let_the_second_pass(folder)
        self._events = EventFile(folder, hidden_from=steps + 1)

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0) -> None:
        """Write numbers; they are on disk before the checkpoint that follows."""
        shown = {key: value for key, value in key_values.items() if "tensorboard" not in (key_excluded.get(key) or ())}
        self._events.write(shown, step)

    def close(self) -> None:
        """Close the file."""
        self._events.close()


def _let_the_second_pass(folder: Path | str) -> None:
    """Wait until a new log comes after those that are there: TensorBoard goes by the second in their names."""
    begun = [int(path.name.split(".")[3]) for path in Path(folder).glob("events.out.tfevents.[0-9]*.*")]
    left = max(begun, default=0) + 1 - time.time()
    if 0.0 < left <= 1.0:
        time.sleep(left)
