"""The state of the global random generators of Python, NumPy and torch: collected, checked and loaded."""

import math
import random
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from contactsafe.learning.checking import CheckpointError, check_tensor, entry


def random_state() -> dict[str, Any]:
    """Collect the state of Python's, NumPy's and torch's global random generators."""
    kind, keys, position, has_gauss, gauss = np.random.get_state(legacy=True)
    version, internal, gauss_next = random.getstate()
    return {
        "torch": torch.get_rng_state(),
        "numpy": [kind, np.asarray(keys).tolist(), int(position), int(has_gauss), float(gauss)],
        "python": [version, list(internal), gauss_next],
    }


def check_random_state(state: dict[str, Any]) -> None:
    """Refuse what `random_state` cannot have collected: the generators use the positions in it unseen.

    Raises:
        CheckpointError: naming the generator.
    """
    for name, now in random_state().items():
        found = entry(state, name, type(now))
        if name == "torch":
            check_tensor(found, now, "random.torch")
            fits = _is_torch_state(found)
        elif len(found) != len(now) or found[0] != now[0] or not isinstance(found[1], list):
            fits = False
        elif name == "numpy":
            fits = _is_twister(found[1], found[2]) and _fits(found[3:])
        else:
            *keys, position = found[1] or [None]
            fits = _is_twister(keys, position) and _fits(found[2:])
        if not fits:
            raise CheckpointError(f"random.{name} is not a state of its generator")


def _is_twister(keys: Any, position: Any) -> bool:
    """Tell whether numbers are a state of the Mersenne Twister."""
    return (
        isinstance(keys, list)
        and len(keys) == 624
        and all(type(key) is int and 0 <= key < 2**32 for key in keys)
        and type(position) is int
        and 0 <= position <= 624
    )


def _fits(values: Sequence[Any]) -> bool:
    """Tell whether values are finite numbers or None, as generators keep a normal number for the next time."""
    return all(value is None or (isinstance(value, int | float) and math.isfinite(value)) for value in values)


def _is_torch_state(state: torch.Tensor) -> bool:
    try:
        torch.Generator().set_state(state)
    except RuntimeError:
        return False
    return True


def load_random_state(state: dict[str, Any]) -> None:
    """Set the generators to what `random_state` collected."""
    torch.set_rng_state(state["torch"])
    kind, keys, position, has_gauss, gauss = state["numpy"]
    np.random.set_state((kind, np.array(keys, dtype=np.uint32), position, has_gauss, gauss))
    version, internal, gauss_next = state["python"]
    random.setstate((version, tuple(internal), gauss_next))
