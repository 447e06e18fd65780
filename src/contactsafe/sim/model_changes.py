"""What may change in a world's model while the world lives: fixtures elsewhere, another friction of the tip."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.robot.arm import Arm, finite_array, unit_quaternion
from contactsafe.robot.mjcf import TIP_GEOM
from contactsafe.sim.config import WorldConfig

CHANGED = ("qpos_spring", "body_pos", "body_quat", "geom_friction")
"""Arrays of MjModel that the functions below write, and obstacles that travel: part of a world's state."""


def own_model(models: Sequence[mujoco.MjModel], i: int) -> mujoco.MjModel:
    """Return world i's model, which is to be changed.

    Raises:
        InvalidInputError: other worlds use it too.
    """
    others = sum(model is models[i] for model in models) - 1
    if others:
        raise InvalidInputError(
            f"the model of world {i} is to change, but {others} other worlds use it; make Worlds(..., shared=False), "
            "or declare `varies = True` in the task"
        )
    return models[i]


def place_fixture(
    model: mujoco.MjModel, config: WorldConfig, name: str, position: ArrayLike, quat: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """Put a fixture elsewhere; return its position, m, and orientation as they were checked.

    Raises:
        InvalidInputError: there is none of that name, or the place is none.
    """
    names = [fixture.name for fixture in config.fixtures]
    if name not in names:
        raise InvalidInputError(f"fixture {shown(name)} is unknown; this world has {', '.join(names) or 'none'}")
    position = finite_array(position, (3,), "position")
    unit_quaternion(quat, "quat")
    quat = np.asarray(quat, dtype=float)
    body = model.body(name).id
    model.body_pos[body], model.body_quat[body] = position, quat
    return position, quat


def set_tip_friction(model: mujoco.MjModel, arm: Arm, friction: float) -> None:
    """Give the tip of the tool another Coulomb coefficient.

    Raises:
        InvalidInputError: it has no tip, or the coefficient is none.
    """
    if arm.tool is None or arm.tool.tip is None:
        raise InvalidInputError(
            f"arm '{arm.name}' has no tip to work with; give it a tool that has, or robots.from_mjcf(..., "
            "tip=robots.Tip(...))"
        )
    if not 0.0 <= finite_array(friction, (), "friction") <= 10.0:
        raise InvalidInputError(f"friction = {friction}; give 0 to 10")
    model.geom_friction[model.geom(TIP_GEOM).id, 0] = friction


def pushed_body(model: mujoco.MjModel, arm: Arm, name: str) -> int:
    """Return the index of a body that may be pushed.

    Raises:
        InvalidInputError: it is no link, and not the tool.
    """
    if name not in ("tool", *(f"link{k + 1}" for k in range(arm.n))):
        raise InvalidInputError(f"body {shown(name)} cannot be pushed; choose link1 to link{arm.n}, or tool")
    return model.body(name).id
