"""Numbers that no arm can have, refused when one is made: in a tick they would become its torque."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.surface import SURFACE_COLUMNS
from contactsafe.robot.touchable import MAX_PLACES

_MODEL = (
    "body_pos", "body_quat", "body_ipos", "body_iquat", "body_mass", "body_inertia", "jnt_pos", "jnt_axis",
    "dof_armature", "site_pos", "site_quat", "qpos0",
)  # fmt: skip

_NOT_NEGATIVE = ("body_mass", "body_inertia", "dof_armature")

_GRAVITY_MAX = 1e3

_TORQUE_RATES = (1e-6, 1e12)
"""N m/s; beyond, what is divided by one is no number."""

_PER_JOINT = {
    "q_min": (), "q_max": (), "qd_max": (), "tau_max": (), "friction": (3,), "home": (), "drag": (3,),
    "friction_unknown": (2,), "sensor_friction": (3,), "sensor_drag": (3,),
}  # fmt: skip
"""What an arm has of every joint, and the shape of it."""


def as_numbers(arm: Any) -> dict[str, np.ndarray | float]:
    """Return an arm's fields that are numbers, as such: arrays of one row a joint, and floats.

    Args:
        arm: `Arm`, as it was given.

    Raises:
        InvalidInputError: a field is not numbers, or of another shape.
    """
    n = int(arm.model.nv)
    fields = {name: array_of(getattr(arm, name), (n, *row), name) for name, row in _PER_JOINT.items()}
    single = {name: float(array_of(getattr(arm, name), (), name)) for name in ("torque_rate_max", "lever_doubted")}
    surfaces = {name: _rows(getattr(arm, name), name) for name in ("surface", "places")}
    return {**fields, **single, **surfaces}


def model_numbers(arm: Any) -> dict[str, np.ndarray]:
    """Return the numbers of an arm's nominal model: masses, frames, axes, rotors, gravity."""
    return {"gravity": arm.model.opt.gravity, **{name: getattr(arm.model, name) for name in _MODEL}}


def _rows(value: Any, name: str) -> np.ndarray:
    points = len(value) if hasattr(value, "__len__") else 0
    return array_of(value, (points, SURFACE_COLUMNS), name)


def array_of(value: ArrayLike, shape: tuple[int, ...], name: str, kind: str = "") -> np.ndarray:
    """Copy numbers into an array of a shape.

    Args:
        value: what was given.
        shape: of the array.
        name: what to call it in errors.
        kind: of the numbers, in errors: "finite " or nothing.

    Raises:
        InvalidInputError: they are no numbers, or of another shape.
    """
    wanted = f"{' × '.join(map(str, shape))} {kind}numbers" if shape else f"one {kind}number"
    try:
        given = np.asarray(value)
        array = np.array(given, dtype=float) if given.dtype.kind != "c" else None
    except (TypeError, ValueError, OverflowError):
        array = None
    if array is None:
        raise InvalidInputError(f"{name} is {type(value).__name__}, not numbers; give {wanted}")
    if array.shape != shape:
        raise InvalidInputError(f"{name} has shape {array.shape}; give {wanted}")
    return array


def refuse_unsound(arm: Any) -> None:
    """Check what an arm is made of.

    Args:
        arm: `Arm`, whose numbers are as `as_numbers` gives them.

    Raises:
        InvalidInputError: gravity, the model, a limit, friction, drag, home or surface is not finite, a mass or
            friction of a joint is negative, or a joint's range is empty.
    """
    _refuse_unsound_model(arm)
    _refuse_unsound_limits(arm)
    _refuse_unsound_friction(arm, "friction", least=0.0)
    _refuse_unsound_friction(arm, "sensor_friction", least=-1.0)  # an error of a sensor may have either sign
    _refuse_unsound_drag(arm, "drag", least=0.0)
    _refuse_unsound_drag(arm, "sensor_drag", least=-1.0)
    for i, (viscous, dry) in enumerate(arm.friction_unknown):
        if not (0.0 <= viscous < np.inf and 0.0 <= dry < np.inf):
            raise InvalidInputError(
                f"friction_unknown[{i}] = ({viscous:g} N m s/rad, {dry:g} N m); give finite numbers from 0 on"
            )
    for i, position in enumerate(arm.home):
        if not np.isfinite(position):
            raise InvalidInputError(f"home[{i}] = {position:g} rad; give a posture well inside the limits")
    for rows, name in ((arm.surface, "surface"), (arm.places, "places")):
        if not np.isfinite(rows).all():
            raise InvalidInputError(f"{name} of arm '{arm.name}' has a number that is not finite; give finite points")
        if not np.isin(rows[:, 0], np.arange(arm.n + 1)).all():
            raise InvalidInputError(f"{name} of arm '{arm.name}' has a link that is none of 0 to {arm.n}")
    of_tool = arm.places[:, 0] == 0
    if not 0 < len(arm.places) <= MAX_PLACES or not of_tool[-1] or (np.diff(of_tool.astype(int)) < 0).any():
        raise InvalidInputError(
            f"places of arm '{arm.name}' are {len(arm.places)}; give at most {MAX_PLACES}, the tool's (link 0) last"
        )
    if not 0.0 <= arm.lever_doubted < np.inf:
        raise InvalidInputError(f"lever_doubted = {arm.lever_doubted:g} m; give a finite number from 0 on")


def _refuse_unsound_model(arm) -> None:
    gravity = arm.model.opt.gravity
    if not (np.abs(gravity) < _GRAVITY_MAX).all():
        raise InvalidInputError(
            f"gravity = {_listed(gravity)} m/s²; give finite numbers below {_GRAVITY_MAX:g} in the model's option"
        )
    for name in _MODEL:
        if not np.isfinite(getattr(arm.model, name)).all():
            raise InvalidInputError(f"{name} of arm '{arm.name}' has a number that is not finite; mend the model")
        if name in _NOT_NEGATIVE and (getattr(arm.model, name) < 0.0).any():
            raise InvalidInputError(f"{name} of arm '{arm.name}' has a negative number; mend the model")


def _refuse_unsound_limits(arm) -> None:
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
    for i, limit in enumerate(arm.tau_max):
        if limit == np.inf:
            raise InvalidInputError(f"tau_max[{i}] = inf N m is no limit; give what the motor can do")
    least, most = _TORQUE_RATES
    if not least <= arm.torque_rate_max <= most:
        raise InvalidInputError(
            f"torque_rate_max = {arm.torque_rate_max:g} N m/s; give a number from {least:g} to {most:g}: "
            "1e9 allows any torque at once"
        )


def _refuse_unsound_friction(arm, name: str, least: float) -> None:
    """Refuse friction that no motor overcomes, φ1 is the sum of both directions; and less than `least` of the most."""
    for i, (phi1, phi2, phi3) in enumerate(getattr(arm, name)):
        most = 2.0 * arm.tau_max[i]
        if not least * most <= phi1 <= most:
            allowed = f"{least * most:g} to {most:g}"
            raise InvalidInputError(f"{name}[{i}, 0] = {phi1:g} N m; give φ1 from {allowed}, twice tau_max[{i}]")
        if not 0.0 <= phi2 < np.inf:
            raise InvalidInputError(f"{name}[{i}, 1] = {phi2:g} s/rad; give a finite φ2 from 0 on")
        if not np.isfinite(phi3):
            raise InvalidInputError(f"{name}[{i}, 2] = {phi3:g} rad/s; give a finite φ3")


def _refuse_unsound_drag(arm, name: str, least: float) -> None:
    """Refuse what no motor overcomes, and viscous and dry friction of a joint that drive it; `least` as above."""
    for i, (viscous, constant, dry) in enumerate(getattr(arm, name)):
        most = arm.tau_max[i]
        if not np.isfinite(viscous) or (least == 0.0 and viscous < 0.0):
            allowed = "viscous friction from 0 on" if least == 0.0 else "a finite number"
            raise InvalidInputError(f"{name}[{i}, 0] = {viscous:g} N m s/rad; give {allowed}")
        if not abs(constant) <= most:
            raise InvalidInputError(f"{name}[{i}, 1] = {constant:g} N m; give a constant torque within ±{most:g}")
        if not least * most <= dry <= most:
            raise InvalidInputError(
                f"{name}[{i}, 2] = {dry:g} N m; give dry friction from {least * most:g} to {most:g}"
            )


def _listed(numbers) -> str:
    return "(" + ", ".join(f"{number:g}" for number in numbers) + ")"
