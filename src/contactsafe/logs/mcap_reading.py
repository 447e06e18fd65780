"""Logs in MCAP: joint states of ROS 2, and JSON messages with arrays by the usual names. Needs the extra `mcap`."""

import importlib.util
import itertools
import json
import math
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from contactsafe.core.errors import InvalidInputError, shown

_FIELDS = ("position", "velocity", "effort")


def read_mcap(path: Path, topic: str | None, joints: Sequence[str] | None) -> dict[str, np.ndarray]:
    """Return what the messages of one topic have, each name an array with a row a message.

    Args:
        path: of the file.
        topic: whose messages; None for the only one that has joint states.
        joints: names of the arm's joints from base to tip, or what those of the messages end in; None for their order.

    Raises:
        InvalidInputError: the extra is not installed, the file is no sound MCAP, no or several topics have joint
            states, or the joints' names do not fit.
    """
    missing = [name for name in ("mcap", "mcap_ros2") if importlib.util.find_spec(name) is None]
    if missing:
        raise InvalidInputError(f"{path.name} needs {', '.join(missing)}; run: pip install 'contactsafe[mcap]'")
    from mcap.exceptions import McapError

    try:
        by_topic = _messages(path, topic)
        if topic is not None and not by_topic.get(topic):
            by_topic = _messages(path, None)  # to name those that there are
    except OSError:
        raise
    except (McapError, ValueError, LookupError, EOFError, MemoryError, struct.error) as error:
        said = shown(" ".join(str(error).split()) or type(error).__name__)
        raise InvalidInputError(f"{path.name} is no sound MCAP: {said}; record it anew") from None
    return _arrays(path.name, _chosen(path.name, by_topic, topic), joints)


def _chosen(source: str, by_topic: Mapping[str, list[dict[str, Any]]], topic: str | None) -> list[dict[str, Any]]:
    """Return the messages of the topic that was asked for, or of the only one that has joint states."""
    readable = {name: rows for name, rows in by_topic.items() if rows}
    found = {name: rows for name, rows in readable.items() if any("q" in row or "position" in row for row in rows)}
    found = found or readable
    if topic in readable:
        return readable[topic]
    if not found:
        topics = f"its topics are {', '.join(sorted(by_topic))}" if by_topic else "it has no topic"
        raise InvalidInputError(f"{source} has no messages that can be read: {topics}; give one with joint states")
    listed = f"joint states are on {', '.join(sorted(found))}"
    if topic is not None:
        raise InvalidInputError(f"{source} has no joint states on topic {shown(topic)}; {listed}")
    if len(found) > 1:
        raise InvalidInputError(f"{source}: {listed}; say which, --topic NAME")
    return next(iter(found.values()))


def _messages(path: Path, topic: str | None) -> dict[str, list[dict[str, Any]]]:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    """Return the messages of one topic or of all that can be read, by topic; those of others are empty."""
    factory, decoders = DecoderFactory(), dict[int, Any]()
    found: dict[str, list[dict[str, Any]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(topics=None if topic is None else [topic]):
            rows = found.setdefault(channel.topic, [])
            if channel.message_encoding == "json":
                row = _from_json(message.data)
            elif channel.message_encoding == "cdr" and schema is not None and schema.name.endswith("/JointState"):
                if schema.id not in decoders:
                    decoders[schema.id] = factory.decoder_for(channel.message_encoding, schema)
                decode = decoders[schema.id]
                row = {} if decode is None else _from_joint_state(decode(message.data))
            else:
                continue
            if row:
                row.setdefault("time", 1e-9 * message.log_time)
                rows.append(row)
    return found


def _from_json(data: bytes) -> dict[str, Any]:
    """Return the numbers and arrays of a JSON message, its stamp as a time, and names of joints where it has them."""
    try:
        message = json.loads(data)
    except (ValueError, RecursionError):
        return {}
    if not isinstance(message, Mapping):
        return {}
    header = message.get("header")
    stamp = (header if isinstance(header, Mapping) else message).get("stamp")
    row = {str(name): value for name, value in message.items() if isinstance(value, list | int | float) and value != []}
    if not isinstance(row.get("name", []), list):
        del row["name"]
    if isinstance(stamp, Mapping):
        seconds = _number(stamp.get("sec", 0)) + 1e-9 * _number(stamp.get("nanosec", stamp.get("nsec", 0)))
        row |= {"time": seconds} if seconds > 0.0 else {}
    return row


def _number(value: Any) -> float:
    """Return a number of JSON, NaN for what is none."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _from_joint_state(message: Any) -> dict[str, Any]:
    stamp = message.header.stamp
    seconds = float(stamp.sec) + 1e-9 * float(stamp.nanosec)
    row: dict[str, Any] = {"time": seconds} if seconds > 0.0 else {}
    row |= {name: list(getattr(message, name)) for name in _FIELDS if len(getattr(message, name)) > 0}
    return row | {"name": list(message.name)}


def _arrays(source: str, rows: list[dict[str, Any]], joints: Sequence[str] | None) -> dict[str, np.ndarray]:
    """Gather messages by what they hold; what is not in all of them, or is no number, is left out."""
    common = set.intersection(*(set(row) for row in rows)) - {"name"}
    ordered = list(_in_order(source, rows, joints))
    found = {}
    for name in sorted(common):
        try:
            values = np.array([row[name] for row in ordered], dtype=float)
        except (ValueError, TypeError, OverflowError):
            continue
        found[name] = values
    return found


def _in_order(source: str, rows: list[dict[str, Any]], joints: Sequence[str] | None) -> Iterator[dict[str, Any]]:
    """Yield messages with their arrays in the order of the arm's joints, each by its own list of names."""
    orders: dict[tuple[str, ...], list[int]] = {}
    first: tuple[str, ...] | None = None
    for row in rows:
        names = tuple(str(name) for name in row.get("name", ()))
        if not names:
            yield row
            continue
        first = first or names
        if names not in orders:
            wanted = [names.index(name) for name in first] if set(names) == set(first) else None
            if joints is not None:
                wanted = joint_order(source, names, joints)
            if wanted is None:
                raise InvalidInputError(f"{source}: messages name different joints; give the topic of one robot")
            orders[names] = wanted
        order = orders[names]
        yield {
            key: [value[k] for k in order] if isinstance(value, list) and len(value) == len(names) else value
            for key, value in row.items()
            if key != "name"
        }


def joint_order(source: str, names: Sequence[str], joints: Sequence[str]) -> list[int]:
    """Return where each of an arm's joints stands among the names of a message.

    A message's name fits if it ends in the arm's, as panda_joint1 in joint1; where several fit one joint, as
    panda_finger_joint1 does, those that all begin alike are taken. Where none fit, as many names as joints are taken in
    their order if the numbers in them ascend, for they say the same.

    Raises:
        InvalidInputError: some fit and others do not, several fit one joint, or there is no telling.
    """
    fitting = [[k for k, name in enumerate(names) if name == joint] for joint in joints]
    if not all(len(found) == 1 for found in fitting):
        fitting = [[k for k, name in enumerate(names) if name.endswith(joint)] for joint in joints]
        begin = [{name.removesuffix(joint) for name in names if name.endswith(joint)} for joint in joints]
        alike = set.intersection(*begin) if begin else set()
        if len(alike) == 1:
            (prefix,) = alike
            fitting = [[k for k, name in enumerate(names) if name == prefix + joint] for joint in joints]
    if all(len(found) == 1 for found in fitting):
        return [found[0] for found in fitting]
    numbers = [re.findall(r"\d+", name) for name in names]
    ascending = all(numbers) and all(int(a[-1]) < int(b[-1]) for a, b in itertools.pairwise(numbers))
    if not any(fitting) and len(names) == len(joints) and ascending:
        return list(range(len(names)))
    raise InvalidInputError(
        f"{source} has joints {', '.join(names)}, the arm {', '.join(joints)}; say which are the arm's from base to "
        "tip, --joints NAME ..."
    )
