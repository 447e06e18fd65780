"""The flight recorder: a process that takes ticks and policy steps out of their rings and writes them to MCAP.

Nothing of it is in the control loop, and what it has written can be read after any process was killed: messages stand
one behind the other in the file, and each write reaches the system at once.
"""

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from contactsafe.core.copying import Unique
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.process import ignore_terminal
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.heartbeats import Heartbeats
from contactsafe.hardware.run_log import CDR, RUN, STEPS_TOPIC, TICKS_TOPIC, ros_schema

_EVERY_S = 0.02


class _File:
    """Every write goes to the system at once."""

    def __init__(self, path: Path):
        self._handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o644)
        self._at = 0

    def write(self, data: Any) -> int:
        view = memoryview(data)
        while len(view):
            view = view[os.write(self._handle, view) :]
        self._at += len(memoryview(data))
        return len(memoryview(data))

    def tell(self) -> int:
        return self._at

    def flush(self) -> None:
        pass

    def close(self) -> None:
        os.close(self._handle)


class Recorder(Unique):
    """Writes one run.

    Args:
        exchange: of the run.
        path: of the file.
        run: what runs, for whoever reads it: texts by name.
    """

    _why = "a recorder writes one file; make another one"

    def __init__(self, exchange: Exchange, path: Path, run: Mapping[str, str]):
        try:
            from mcap.writer import Writer
        except ImportError:
            raise InvalidInputError("mcap is not installed; run: pip install 'contactsafe[mcap]'") from None
        self.exchange, self._file = exchange, _File(path)
        self._writer = Writer(cast(Any, self._file), use_chunking=False)
        self._writer.start(profile="ros2", library="contactsafe")
        self._writer.add_metadata(RUN, {name: str(value) for name, value in run.items()})
        self._ticks = self._channel(TICKS_TOPIC, exchange.ticks.dtype, "Tick")
        self._steps = self._channel(STEPS_TOPIC, exchange.steps.dtype, "Step")
        self._at = {"rows": 0, "steps_written": 0}

    def _channel(self, topic: str, dtype: np.dtype, name: str) -> int:
        schema = self._writer.register_schema(
            name=f"contactsafe/msg/{name}", encoding="ros2msg", data=ros_schema(dtype, name).encode()
        )
        return self._writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)

    def drain(self) -> None:
        """Write what has come since the last time."""
        status = self.exchange.status
        self._take(self.exchange.ticks, "rows", self._ticks)
        self._take(self.exchange.steps, "steps_written", self._steps)
        status["recorded"] = self._at["rows"]

    def _take(self, ring: np.ndarray, counter: str, channel: int) -> None:
        status, size = self.exchange.status, len(ring)
        upto = int(status[counter][0])
        first = max(self._at[counter], upto - size + 64)  # what is about to be written over is left alone
        if counter == "rows":
            status["dropped"] += first - self._at[counter]
        for number in range(first, upto):
            row = ring[number % size]
            stamp = int(row["stamp"])
            self._writer.add_message(
                channel_id=channel, log_time=stamp, publish_time=stamp, data=CDR + row.tobytes(), sequence=number
            )
        self._at[counter] = upto

    def finish(self) -> None:
        """Write the end of the file."""
        self._writer.finish()
        self._file.close()


def record(exchange_path: str, path: Path, run: Mapping[str, str]) -> None:
    """Be the recorder of a run, until the control process has let go of the robot, or nobody is left."""
    ignore_terminal()
    exchange = Exchange(exchange_path)
    status = exchange.status
    status["pid_recorder"] = os.getpid()
    try:
        recorder = Recorder(exchange, path, run)
        heartbeats = Heartbeats(status)
        while not status["finished"][0] and not heartbeats.have_stopped():
            status["beat_recorder"] += 1
            recorder.drain()
            time.sleep(_EVERY_S)
        recorder.drain()
        recorder.finish()
    except OSError as error:
        status["recorder_errno"] = error.errno or -1
        print(f"recorder: {path}: {error.strerror}; the run goes on without a log from here", flush=True)
    except InvalidInputError as error:
        status["recorder_errno"] = -1
        print(f"recorder: {error}", flush=True)
