"""Logs in MCAP: joint states of ROS 2, and JSON messages with arrays by the usual names. Needs the extra `mcap`."""

import importlib.util
import itertools
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
    except OSError:
        raise
    except (McapError, ValueError, LookupError, EOFError, MemoryError) as error:
        said = shown(" ".join(str(error).split()) or type(error).__name__)
        raise InvalidInputError(f"{path.name} is no sound MCAP: {said}; record it anew") from None
    found = {name: rows for name, rows in by_topic.items() if any("q" in row or "position" in row for row in rows)}
    found = found or by_topic
    if topic is not None and topic not in by_topic:
        raise InvalidInputError(f"{path.name} has no joint states on topic {shown(topic)}; {_listed(found)}")
    if len(found) != 1 and topic is None:
        raise InvalidInputError(f"{path.name}: {_listed(found)}; say which, --topic NAME")
    rows = found.get(topic, by_topic.get(topic, [])) if topic is not None else next(iter(found.values()))
    return _arrays(path.name, rows, joints)


def _listed(topics: Iterable[str]) -> str:
    names = sorted(topics)
    return f"joint states are on {', '.join(names)}" if names else "no topic has messages that can be read"


def _messages(path: Path, topic: str | None) -> dict[str, list[dict[str, Any]]]:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    factory, decoders = DecoderFactory(), dict[int, Any]()
    found: dict[str, list[dict[str, Any]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(topics=None if topic is None else [topic]):
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
                found.setdefault(channel.topic, []).append(row)
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
    if isinstance(stamp, Mapping):
        seconds = float(stamp.get("sec", 0)) + 1e-9 * float(stamp.get("nanosec", stamp.get("nsec", 0)))
        row |= {"time": seconds} if seconds > 0.0 else {}
    return row


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
        except (ValueError, TypeError):
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

    A message's name fits if it ends in the arm's, as panda_joint1 in joint1. Where none fit, as many names as joints
    are taken in their order if the numbers in them ascend, for they say the same.

    Raises:
        InvalidInputError: some fit and others do not, several fit one joint, or there is no telling.
    """
    fitting = [[k for k, name in enumerate(names) if name == joint] for joint in joints]
    if not all(len(found) == 1 for found in fitting):
        fitting = [[k for k, name in enumerate(names) if name.endswith(joint)] for joint in joints]
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
