"""The log of a run: MCAP, its messages records as they lie in memory, described as ROS 2 has it; and how to read it."""

import contextlib
import struct
from pathlib import Path

import numpy as np

from contactsafe.core.errors import InvalidInputError

TICKS_TOPIC, STEPS_TOPIC = "/contactsafe/ticks", "/contactsafe/steps"
RUN = "contactsafe run"
"""Name of the metadata that say what ran."""

CDR = b"\x00\x01\x00\x00"
"""Head of a little-endian CDR message; records of 64-bit numbers follow as they lie in memory."""


def ros_schema(dtype: np.dtype, name: str) -> str:
    """Return the ROS 2 message definition of a record of 64-bit numbers, its nested records behind it."""
    nested: dict[str, np.dtype] = {}

    def lines(record: np.dtype) -> str:
        out = []
        for field in record.names or ():
            base, shape = record[field].base, record[field].shape
            count = f"[{int(np.prod(shape))}]" if shape else ""
            if base.names:
                kind = f"contactsafe/{field.title().replace('_', '')}"
                nested[kind] = base
            else:
                kind = "int64" if base.kind == "i" else "float64"
            out.append(f"{kind}{count} {field.lower()}")
        return "\n".join(out)

    text, done = lines(dtype), set[str]()
    while todo := [kind for kind in nested if kind not in done]:
        done.add(todo[0])
        text += f"\n{'=' * 80}\nMSG: {todo[0]}\n{lines(nested[todo[0]])}"
    return text


def is_run(path: Path) -> bool:
    """Tell whether a file is a run that `Recorder` has written."""
    with open(path, "rb") as file:
        return RUN.encode() in file.read(4096)


def read_run(path: Path, dtype: np.dtype, topic: str = TICKS_TOPIC) -> tuple[dict[str, str], np.ndarray]:
    """Read a run that was recorded, also one whose file ends in the middle.

    Args:
        path: of the file.
        dtype: of the topic's records, `row_dtype(n)` or `step_dtype()`.
        topic: of them.

    Returns:
        What ran, by name, and the records in order.

    Raises:
        InvalidInputError: it is no recorded run.
    """
    from mcap.exceptions import McapError
    from mcap.records import Channel, Message, Metadata
    from mcap.stream_reader import StreamReader

    run: dict[str, str] = {}
    rows, channels = [], set[int]()
    with open(path, "rb") as file, contextlib.suppress(McapError, EOFError, struct.error):
        for item in StreamReader(file).records:
            if isinstance(item, Metadata) and item.name == RUN:
                run = dict(item.metadata)
            elif isinstance(item, Channel) and item.topic == topic:
                channels.add(item.id)
            elif isinstance(item, Message) and item.channel_id in channels:
                rows.append(item.data[len(CDR) :])
    if not run or any(len(row) != dtype.itemsize for row in rows):
        raise InvalidInputError(f"{path} is no run that this version of contactsafe has recorded")
    return run, np.frombuffer(b"".join(rows), dtype)
