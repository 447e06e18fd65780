"""Whether what was read from a checkpoint can have been written by a run: kinds, keys, shapes, bounds."""

import math
from typing import Any

import torch

from contactsafe.core.errors import InvalidInputError, shown


class CheckpointError(InvalidInputError):
    """A checkpoint holds what no run can have written; the text says where and what."""


def entry(state: Any, name: str, kind: type | tuple[type, ...]) -> Any:
    """Return an entry of a checkpoint's state, a dict, that must be there and of a kind."""
    if not isinstance(state, dict) or name not in state:
        raise CheckpointError(f"{name} is missing")
    value = state[name]
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise CheckpointError(f"{name} is {shown(value)}, not {getattr(kind, '__name__', 'a number')}")
    return value


def whole(state: Any, name: str, most: int = 2**53) -> int:
    """Return an entry of a state that is a whole number from 0 to most."""
    value = entry(state, name, int)
    if not 0 <= value <= most:
        raise CheckpointError(f"{name} = {shown(value)} is outside [0, {most}]")
    return value


def check_like(found: Any, wanted: Any, path: str) -> None:
    """Refuse nested values that are not of the kinds, keys, lengths, types and shapes of others, or not finite.

    Args:
        found: from a checkpoint.
        wanted: what would be written now.
        path: what to call it in errors.

    Raises:
        CheckpointError: they differ by more than numbers.
    """
    if isinstance(wanted, dict):
        if not isinstance(found, dict) or set(found) != set(wanted):
            lacks = sorted(map(str, set(wanted) - set(found))) if isinstance(found, dict) else ["all"]
            raise CheckpointError(f"{path} is not what it should hold (missing: {shown(lacks)})")
        for name, value in wanted.items():
            check_like(found[name], value, f"{path}.{name}")
    elif isinstance(wanted, list | tuple):
        if not isinstance(found, list | tuple) or len(found) != len(wanted):
            raise CheckpointError(f"{path} is {shown(found)}, not a list of {len(wanted)}")
        for i, value in enumerate(wanted):
            check_like(found[i], value, f"{path}[{i}]")
    elif isinstance(wanted, torch.Tensor):
        check_tensor(found, wanted, path)
    elif type(wanted) in (int, float):
        if not isinstance(found, int | float) or isinstance(found, bool) or not math.isfinite(found):
            raise CheckpointError(f"{path} is {shown(found)}, not a number")
    elif type(found) is not type(wanted) or found != wanted:
        raise CheckpointError(f"{path} is {shown(found)}, not {shown(wanted)}")


def check_tensor(found: Any, wanted: torch.Tensor, path: str) -> None:
    """Refuse a tensor of another type or shape than wanted, or that is not finite."""
    if not isinstance(found, torch.Tensor) or found.layout != torch.strided or found.dtype != wanted.dtype:
        raise CheckpointError(f"{path} is {kind_of(found)}, not {wanted.dtype}")
    if found.shape != wanted.shape:
        raise CheckpointError(f"{path} has shape {tuple(found.shape)}, not {tuple(wanted.shape)}")
    if found.is_floating_point() and not torch.isfinite(found).all():
        raise CheckpointError(f"{path} is not finite")


def kind_of(found: Any) -> Any:
    """Say what kind of value was found."""
    return found.dtype if isinstance(found, torch.Tensor) else shown(found)


def check_optimiser(found: Any, optimiser: torch.optim.Optimizer, path: str) -> None:
    """Refuse the state of an optimiser that does not fit its parameters.

    Args:
        found: from a checkpoint.
        optimiser: of torch, over the parameters that it is for.
        path: what to call it in errors.

    Raises:
        CheckpointError: it is of other parameters, or not finite.
    """
    now = optimiser.state_dict()
    check_like(entry(found, "param_groups", list), now["param_groups"], f"{path}.param_groups")
    if [group["params"] for group in found["param_groups"]] != [group["params"] for group in now["param_groups"]]:
        raise CheckpointError(f"{path}.param_groups is of other parameters")
    parameters = [parameter for group in optimiser.param_groups for parameter in group["params"]]
    for index, memory in entry(found, "state", dict).items():
        where = f"{path}.state[{shown(index)}]"
        if type(index) is not int or not 0 <= index < len(parameters) or not isinstance(memory, dict):
            raise CheckpointError(f"{where} is {shown(memory)}, of no parameter")
        for name, value in memory.items():
            like = parameters[index]
            if isinstance(value, torch.Tensor) and value.ndim == 0:
                like = torch.zeros((), dtype=value.dtype)
            check_tensor(value, like, f"{where}.{name}")
            if name != "exp_avg" and (value < 0).any():  # a count of steps, or a mean of squares
                raise CheckpointError(f"{where}.{name} is negative")
