"""Numbers that no arm can have, refused when one is made: in a tick they would become its torque."""

import numpy as np

from contactsafe.errors import InvalidInputError

_MODEL = (
    "body_pos", "body_quat", "body_ipos", "body_iquat", "body_mass", "body_inertia", "jnt_pos", "jnt_axis",
    "dof_armature", "site_pos", "site_quat", "qpos0",
)  # fmt: skip

_GRAVITY_MAX = 1e3


def refuse_unsound(arm) -> None:
    """Check what an arm is made of.

    Args:
        arm: `Arm`, as it was given.

    Raises:
        InvalidInputError: gravity, the model or a limit is not finite, or a joint's range is empty.
    """
    gravity = arm.model.opt.gravity
    if not (np.abs(gravity) < _GRAVITY_MAX).all():
        raise InvalidInputError(
            f"gravity = {_listed(gravity)} m/s²; give finite numbers below {_GRAVITY_MAX:g} in the model's option"
        )
    for name in _MODEL:
        if not np.isfinite(getattr(arm.model, name)).all():
            raise InvalidInputError(f"{name} of arm '{arm.name}' has a number that is not finite; mend the model")
    for i, (low, high) in enumerate(zip(arm.q_min, arm.q_max, strict=True)):
        if not low < high:  # NaN as well
            raise InvalidInputError(
                f"joint '{arm.model.joint(i).name}' has the range [{low:g}, {high:g}] rad; "
                "give a lower end below the upper one, or no range"
            )
    for name, unit in (("qd_max", "rad/s"), ("tau_max", "N m")):
        for i, limit in enumerate(getattr(arm, name)):
            if not limit > 0.0:
                raise InvalidInputError(f"{name}[{i}] = {limit:g} {unit} is no limit; give a number greater than 0")


def _listed(numbers) -> str:
    return "(" + ", ".join(f"{number:g}" for number in numbers) + ")"
