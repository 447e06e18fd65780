"""What decides the future of a simulation, taken out as plain values and put back.

An object lists its state as named parts, each of which knows how to take its value, how to put it back, and which
values it takes at all. Values are arrays, numbers, strings, and dicts and lists of them: no addresses, nothing that
belongs to one process. All of a snapshot is checked before any of it is put back: compiled code trusts its indices.
"""

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.sim.mujoco_record import VIEWED

_READ = (*VIEWED, "cdof", "subtree_com")
"""Arrays of MjData that are read before a step fills them anew; the last two by mj_jac, for a push."""


class Part(NamedTuple):
    """One piece of an object's state.

    Attributes:
        take: returns its value now, a copy.
        put: sets it to a value that `take` gave.
        check: raises InvalidInputError for a value that no `take` can have given.
    """

    take: Callable[[], Any]
    put: Callable[[Any], None]
    check: Callable[[Any], None] = lambda value: None


Parts = Mapping[str, Part]
Bounds = Mapping[str, tuple[float, float]]

COUNT = (-1, 2**53)
"""Bounds of integers that count and index nothing."""

MEASURE = (-1e9, 1e9)
"""Bounds of numbers with a unit: what is beyond is no state of a simulation, but overflows somewhere."""


class _StateError(InvalidInputError):
    """A value that cannot be put back, and the names of the parts it lies in."""

    def __init__(self, what: str, *path: str):
        place = f" ({'.'.join(path)})" if path else ""
        super().__init__(f"the snapshot holds {what}{place}; start anew")
        self.what, self.path = what, path


def take(parts: Parts) -> dict[str, Any]:
    """Take the value of every part."""
    return {name: part.take() for name, part in parts.items()}


def put(parts: Parts, snapshot: Mapping[str, Any]) -> None:
    """Put every part back, in the order in which they are listed; nothing is changed where one of them is refused.

    Raises:
        InvalidInputError: the snapshot has other parts, an array of another shape, or a value that cannot be.
    """
    check(parts, snapshot)
    for name, part in parts.items():
        part.put(snapshot[name])


def check(parts: Parts, snapshot: Mapping[str, Any]) -> None:
    """Refuse a snapshot that `put` could not put back.

    Raises:
        InvalidInputError: as for `put`.
    """
    if not isinstance(snapshot, Mapping) or set(parts) != set(snapshot):
        found = ", ".join(sorted(map(str, snapshot))) if isinstance(snapshot, Mapping) else shown(snapshot)
        raise _StateError(f"{found[:160]}, not {', '.join(sorted(parts))[:160]}")
    for name, part in parts.items():
        try:
            part.check(snapshot[name])
        except _StateError as error:
            raise _StateError(error.what, name, *error.path) from None


def of_object(owner: Any) -> Part:
    """Let an object that has `snapshot` and `restore` of its own, and `parts` to be checked, be a part."""
    return Part(
        owner.snapshot, owner.restore, lambda value: check(owner.parts(), value) if hasattr(owner, "parts") else None
    )


def of_array(array: np.ndarray, low: float = MEASURE[0], high: float = MEASURE[1]) -> Part:
    """Let an array be a part; it is filled in place, with nothing outside [low, high]."""
    return Part(array.copy, lambda value: _fill(array, value), lambda value: _check_array(array, value, low, high))


def of_records(records: np.ndarray, bounds: Bounds | None = None, fixed: tuple[str, ...] = ()) -> Part:
    """Let structured records be a part, field by field, without the addresses they hold.

    Args:
        records: of a structured dtype.
        bounds: by name of a field, what it may be, both ends included; else COUNT for integers and MEASURE for others,
            of which a single number may also be inf, which stands for "no bound".
        fixed: beginnings of the names of fields that, unless they have bounds, are what the records were made with,
            such as places in arrays.
    """
    known = bounds or {}

    def part(name: str, field: np.ndarray) -> Part:
        plain = of_array(field, *known.get(name, COUNT if field.dtype.kind in "iu" else MEASURE))
        if name in known:
            return plain
        if name.startswith(fixed):
            return plain._replace(check=functools.partial(_check_same, field))
        if field.ndim == 1 and field.dtype.kind == "f":
            return plain._replace(check=lambda value: plain.check(_without_inf(value)))
        return plain

    def fields() -> dict[str, Part]:
        return {name: part(name, field) for name, field in _fields(records)}

    return Part(
        lambda: {name: field.copy() for name, field in _fields(records)},
        lambda values: put(fields(), values),
        lambda values: check(fields(), values),
    )


def of_generators(generators: list[np.random.Generator]) -> Part:
    """Let a list of random generators be a part; it is filled anew, so it may be empty before."""

    def replace(states: Sequence[dict]) -> None:
        generators[:] = [_generator(state) for state in states]

    def check_states(states: Sequence[dict]) -> None:
        if not isinstance(states, list) or len(states) not in (len(generators) or len(states), 0):
            raise _StateError(f"{shown(states)} for {len(generators)} random generators")
        for state in states:
            _generator(state)

    return Part(lambda: [generator_state(generator) for generator in generators], replace, check_states)


def of_physics(models: Sequence[mujoco.MjModel], datas: Sequence[mujoco.MjData]) -> Part:
    """Let MuJoCo's data be a part.

    Its state says how it goes on. The arrays that compiled code reads are kept beside it, for after a step they still
    belong to that step's beginning and cannot be computed from where it ended.
    """

    def put_back(values: Sequence[Mapping[str, np.ndarray]]) -> None:
        for model, data, value in zip(models, datas, values, strict=True):
            mujoco.mj_setState(model, data, value["state"], mujoco.mjtState.mjSTATE_INTEGRATION)
            model.qpos_spring[:] = value["qpos_spring"]
            for name in _READ:
                _fill(getattr(data, name), value[name])

    def check_values(values: Sequence[Mapping[str, np.ndarray]]) -> None:
        if not isinstance(values, list) or len(values) != len(datas):
            raise _StateError(f"{shown(values)} for the physics of {len(datas)} worlds")
        for model, data, value in zip(models, datas, values, strict=True):
            check({name: of_array(array) for name, array in _physics(model, data).items()}, value)

    return Part(
        lambda: [_physics(model, data) for model, data in zip(models, datas, strict=True)], put_back, check_values
    )


def generator_state(generator: np.random.Generator) -> dict[str, Any]:
    """Return the state of a random generator as numbers, strings and lists."""
    return _plain(generator.bit_generator.state)


def _physics(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, np.ndarray]:
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    arrays = {name: getattr(data, name).copy() for name in _READ}
    return {"state": state, "qpos_spring": model.qpos_spring.copy(), **arrays}


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
        raise InvalidInputError(f"the snapshot holds {found} for one of {array.shape}; start anew")
    if value.dtype != array.dtype:
        raise _StateError(f"{value.dtype} for {array.dtype}")
    # A truth is a byte, in which compiled code may find nothing but 0 and 1; NaN is outside whatever the bounds are.
    numbers, most = (value.view(np.uint8), 1) if array.dtype.kind == "b" else (value, high)
    outside = ~((numbers >= low) & (numbers <= most))
    if outside.any():
        raise _StateError(f"{shown(value[outside][0].item())}, which cannot be")


def _without_inf(value: Any) -> Any:
    is_measure = isinstance(value, np.ndarray) and value.dtype.kind == "f"
    return np.where(np.isposinf(value), 0.0, value) if is_measure else value


def _check_same(array: np.ndarray, value: np.ndarray) -> None:
    if not np.array_equal(array, value):
        raise _StateError("what was made otherwise")


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
        raise _StateError(f"{shown(state)}, which is not the state of a random generator") from None
    return np.random.Generator(bits)
