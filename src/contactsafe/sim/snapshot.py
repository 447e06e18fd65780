"""What decides the future of a simulation, taken out as plain values and put back.

An object lists its state as named parts, each of which knows how to take its value and how to put it back. Values are
arrays, numbers, strings, and dicts and lists of them: no addresses, nothing that belongs to one process.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from contactsafe.errors import InvalidInputError
from contactsafe.sim.records import VIEWED

_READ = (*VIEWED, "cdof", "subtree_com")
"""Arrays of MjData that are read before a step fills them anew; the last two by mj_jac, for a push."""


class Part(NamedTuple):
    """One piece of an object's state.

    Attributes:
        take: gives its value now, a copy.
        put: sets it to a value that `take` gave.
    """

    take: Callable[[], Any]
    put: Callable[[Any], None]


Parts = Mapping[str, Part]


def take(parts: Parts) -> dict[str, Any]:
    """Take the value of every part."""
    return {name: part.take() for name, part in parts.items()}


def put(parts: Parts, snapshot: Mapping[str, Any]) -> None:
    """Put every part back, in the order in which they are listed.

    Raises:
        InvalidInputError: the snapshot has other parts, or an array of another shape.
    """
    if set(parts) != set(snapshot):
        raise InvalidInputError(
            f"the snapshot holds {', '.join(sorted(snapshot))}, not {', '.join(sorted(parts))}; start anew"
        )
    for name, part in parts.items():
        part.put(snapshot[name])


def of_object(owner: Any) -> Part:
    """Let an object that has `snapshot` and `restore` of its own be a part."""
    return Part(owner.snapshot, owner.restore)


def of_array(array: np.ndarray) -> Part:
    """Let an array be a part; it is filled in place."""
    return Part(array.copy, lambda value: _fill(array, value))


def of_records(records: np.ndarray) -> Part:
    """Let structured records be a part, field by field, without the addresses they hold."""

    def set_fields(values: Mapping[str, np.ndarray]) -> None:
        put({name: of_array(field) for name, field in _fields(records)}, values)

    return Part(lambda: {name: field.copy() for name, field in _fields(records)}, set_fields)


def of_generators(generators: list[np.random.Generator]) -> Part:
    """Let a list of random generators be a part; it is filled anew, so it may be empty before."""

    def replace(states: Sequence[dict]) -> None:
        generators[:] = [_generator(state) for state in states]

    return Part(lambda: [generator_state(generator) for generator in generators], replace)


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

    return Part(lambda: [_physics(model, data) for model, data in zip(models, datas, strict=True)], put_back)


def generator_state(generator: np.random.Generator) -> dict[str, Any]:
    """Give the state of a random generator as numbers, strings and lists."""
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
    if array.shape != np.shape(value):
        raise InvalidInputError(f"the snapshot holds an array {np.shape(value)} for one of {array.shape}; start anew")
    array[...] = value


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _generator(state: dict[str, Any]) -> np.random.Generator:
    bits = getattr(np.random, state["bit_generator"])()
    bits.state = state
    return np.random.Generator(bits)
