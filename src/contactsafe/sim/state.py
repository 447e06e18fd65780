"""The state of MuJoCo's physics, as an entry of `contactsafe.core.state`."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from contactsafe.core.errors import shown
from contactsafe.core.state import Entry, StateError, check_state_dict, of_array
from contactsafe.sim.model_changes import CHANGED
from contactsafe.sim.mujoco_record import VIEWED

_READ = (*VIEWED, "cdof", "subtree_com")
"""Arrays of MjData that are read before a step fills them anew; the last two by mj_jac, for a push."""


def of_physics(models: Sequence[mujoco.MjModel], datas: Sequence[mujoco.MjData]) -> Entry:
    """Make an entry of MuJoCo's data.

    Its state says how it goes on, with what episodes change in the model. The arrays that compiled code reads are kept
    beside it, for after a step they still belong to that step's beginning and cannot be computed from where it ended.
    """

    def write(values: Sequence[Mapping[str, np.ndarray]]) -> None:
        for model, data, value in zip(models, datas, values, strict=True):
            mujoco.mj_setState(model, data, value["state"], mujoco.mjtState.mjSTATE_INTEGRATION)
            for name in CHANGED:
                getattr(model, name)[...] = value[name]
            for name in _READ:
                getattr(data, name)[...] = value[name]

    def check_values(values: Sequence[Mapping[str, np.ndarray]]) -> None:
        if not isinstance(values, list) or len(values) != len(datas):
            raise StateError(f"{shown(values)} for the physics of {len(datas)} worlds")
        for model, data, value in zip(models, datas, values, strict=True):
            check_state_dict({name: of_array(array) for name, array in _physics(model, data).items()}, value)

    return Entry(
        lambda: [_physics(model, data) for model, data in zip(models, datas, strict=True)], write, check_values
    )


def _physics(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, np.ndarray]:
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    of_model = {name: getattr(model, name).copy() for name in CHANGED}
    return {"state": state, **of_model, **{name: getattr(data, name).copy() for name in _READ}}
