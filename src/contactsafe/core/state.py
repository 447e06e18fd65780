"""The state of an object as a dict of plain values, and loaded from one.

An object lists its state as named entries, each of which knows how to read its value, how to write it, and which values
it takes at all. Values are arrays, numbers, strings, and dicts and lists of them: no addresses, nothing that belongs to
one process. All of a state is checked before any of it is loaded: compiled code trusts its indices.
"""

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from contactsafe.core.errors import InvalidInputError, shown


class Entry(NamedTuple):
    """One entry of an object's state.

    Attributes:
        read: returns its value now, a copy.
        write: sets it to a value that `read` returned.
        check: raises InvalidInputError for a value that no `read` can have returned.
    """

    read: Callable[[], Any]
    write: Callable[[Any], None]
    check: Callable[[Any], None] = lambda value: None


Entries = Mapping[str, Entry]
Bounds = Mapping[str, tuple[float, float]]

COUNT = (-1, 2**53)
"""Bounds of integers that count and index nothing."""

MEASURE = (-1e9, 1e9)
"""Bounds of numbers with a unit: what is beyond is no state of a simulation, but overflows somewhere."""


class StateError(InvalidInputError):
    """A value that cannot be loaded, and the names of the entries it lies in."""

    def __init__(self, what: str, *path: str):
        place = f" ({'.'.join(path)})" if path else ""
        super().__init__(f"the state holds {what}{place}; start anew")
        self.what, self.path = what, path


def state_dict(entries: Entries) -> dict[str, Any]:
    """Return the value of every entry."""
    return {name: entry.read() for name, entry in entries.items()}


def load_state_dict(entries: Entries, state: Mapping[str, Any]) -> None:
    """Load every entry, in the order in which they are listed; nothing is changed where one of them is refused.

    Raises:
        InvalidInputError: the state has other entries, an array of another shape, or a value that cannot be.
    """
    check_state_dict(entries, state)
    for name, entry in entries.items():
        entry.write(state[name])


def check_state_dict(entries: Entries, state: Mapping[str, Any]) -> None:
    """Refuse a state that `load_state_dict` could not load.

    Raises:
        InvalidInputError: as for `load_state_dict`.
    """
    if not isinstance(state, Mapping) or set(entries) != set(state):
        found = ", ".join(sorted(map(str, state))) if isinstance(state, Mapping) else shown(state)
        raise StateError(f"{found[:160]}, not {', '.join(sorted(entries))[:160]}")
    for name, entry in entries.items():
        try:
            entry.check(state[name])
        except StateError as error:
            raise StateError(error.what, name, *error.path) from None


def of_object(owner: Any) -> Entry:
    """Make an entry of an object that has `state_dict` and `load_state_dict`, and `state_entries` to be checked."""
    return Entry(
        owner.state_dict,
        owner.load_state_dict,
        lambda value: check_state_dict(owner.state_entries(), value) if hasattr(owner, "state_entries") else None,
    )


def of_array(array: np.ndarray, low: float = MEASURE[0], high: float = MEASURE[1]) -> Entry:
    """Make an entry of an array; it is filled in place, with nothing outside [low, high]."""
    return Entry(array.copy, lambda value: _fill(array, value), lambda value: _check_array(array, value, low, high))


def of_records(records: np.ndarray, bounds: Bounds | None = None, fixed: tuple[str, ...] = ()) -> Entry:
    """Make an entry of structured records, field by field, without the addresses they hold.

    Args:
        records: of a structured dtype.
        bounds: by name of a field, what it may be, both ends included; else COUNT for integers and MEASURE for others,
            of which a single number may also be inf, which stands for "no bound".
        fixed: beginnings of the names of fields that, unless they have bounds, are what the records were made with,
            such as places in arrays.
    """
    known = bounds or {}

    def entry(name: str, field: np.ndarray) -> Entry:
        plain = of_array(field, *known.get(name, COUNT if field.dtype.kind in "iu" else MEASURE))
        if name in known:
            return plain
        if name.startswith(fixed):
            return plain._replace(check=functools.partial(_check_same, field))
        if field.ndim == 1 and field.dtype.kind == "f":
            return plain._replace(check=lambda value: plain.check(_without_inf(value)))
        return plain

    def fields() -> dict[str, Entry]:
        return {name: entry(name, field) for name, field in _fields(records)}

    return Entry(
        lambda: {name: field.copy() for name, field in _fields(records)},
        lambda values: load_state_dict(fields(), values),
        lambda values: check_state_dict(fields(), values),
    )


def of_generators(generators: list[np.random.Generator]) -> Entry:
    """Make an entry of a list of random generators; it is filled anew, so it may be empty before."""

    def replace(states: Sequence[dict]) -> None:
        generators[:] = [_generator(state) for state in states]

    def check_states(states: Sequence[dict]) -> None:
        if not isinstance(states, list) or len(states) not in (len(generators) or len(states), 0):
            raise StateError(f"{shown(states)} for {len(generators)} random generators")
        for state in states:
            _generator(state)

    return Entry(lambda: [generator_state(generator) for generator in generators], replace, check_states)


def generator_state(generator: np.random.Generator) -> dict[str, Any]:
    """Return the state of a random generator as numbers, strings and lists."""
    return _plain(generator.bit_generator.state)


def _fields(records: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Name and see every field of the records, nested ones by dotted names; addresses are passed over."""
    for name in records.dtype.names or ():
        field = records[name]
        if field.dtype.names:
            yield from ((f"{name}.{inner}", values) for inner, values in _fields(field))
        elif field.dtype != np.uintp:
            yield name, field


def _fill(array: np.ndarray, value: np.ndarray) -> None:
    array[...] = value


def _check_array(array: np.ndarray, value: np.ndarray, low: float, high: float) -> None:
    if not isinstance(value, np.ndarray) or array.shape != value.shape:
        found = f"an array {value.shape}" if isinstance(value, np.ndarray) else shown(value)
        raise InvalidInputError(f"the state holds {found} for one of {array.shape}; start anew")
    if value.dtype != array.dtype:
        raise StateError(f"{value.dtype} for {array.dtype}")
    # A truth is a byte, in which compiled code may find nothing but 0 and 1; NaN is outside whatever the bounds are.
    numbers, most = (value.view(np.uint8), 1) if array.dtype.kind == "b" else (value, high)
    outside = ~((numbers >= low) & (numbers <= most))
    if outside.any():
        raise StateError(f"{shown(value[outside][0].item())}, which cannot be")


def _without_inf(value: Any) -> Any:
    is_measure = isinstance(value, np.ndarray) and value.dtype.kind == "f"
    return np.where(np.isposinf(value), 0.0, value) if is_measure else value


def _check_same(array: np.ndarray, value: np.ndarray) -> None:
    if not np.array_equal(array, value):
        raise StateError("what was made otherwise")


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _generator(state: dict[str, Any]) -> np.random.Generator:
    """Make a generator of a state; only of kinds whose state has no index that could lead anywhere."""
    try:
        bits = {"PCG64": np.random.PCG64, "SFC64": np.random.SFC64}[state["bit_generator"]]()
        bits.state = state
    except (KeyError, TypeError, ValueError, OverflowError):
        raise StateError(f"{shown(state)}, which is not the state of a random generator") from None
    return np.random.Generator(bits)
