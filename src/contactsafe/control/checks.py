"""What a caller gives the controller, checked at the door: what was found, what is allowed, what to do.

Raises of all: InvalidInputError.
"""

from typing import Any

import numpy as np

from contactsafe.control.records import controller_dtype
from contactsafe.control.signals import Target
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm, finite_array
from contactsafe.robot.payload import Payload
from contactsafe.robot.soundness import array_of


def in_range(arm: Arm, q: np.ndarray, name: str, tolerance: float) -> np.ndarray:
    """Check joint positions against the arm's range, (n,), rad; past it by a tolerance at most."""
    past = _past_limits(arm, q)
    if (past <= tolerance).all():
        return q
    i = int(np.argmax(past > tolerance))
    low, high = arm.q_min[i], arm.q_max[i]
    remedy = "move the joint back by hand or in the robot's own mode, or correct the arm's range"
    if name != "q":
        remedy = "give one within the range"
    if np.abs(q).max() > 2.0 * np.pi and (_past_limits(arm, np.radians(q)) <= 0.0).all():
        remedy = "these are degrees, give radians"
    limit = f"above its limit {high:.4f}" if q[i] > high else f"below its limit {low:.4f}"
    raise InvalidInputError(
        f"{name}[{i}] = {q[i]:.4f} rad, joint '{arm.model.joint(i).name}', is {past[i]:.4f} rad {limit}; "
        f"{tolerance} is tolerated: {remedy}"
    )


def _past_limits(arm: Arm, q: np.ndarray) -> np.ndarray:
    return np.maximum(arm.q_min - q, q - arm.q_max)


def believable(qd: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Check velocities against the fastest that an arm gets, (n,), rad/s."""
    if (np.abs(qd) <= most).all():
        return qd
    i = int(np.argmax(np.abs(qd) > most))
    raise InvalidInputError(f"qd[{i}] = {qd[i]:.4g} rad/s is faster than this arm gets, {most[i]:.4g}; give rad/s")


def within_limit(arm: Arm, torque: Any) -> np.ndarray:
    """Check a torque against the limits of the arm, (n,), N m."""
    torque = arm.joint_vector(torque, "torque")
    over = np.abs(torque) > arm.tau_max
    if over.any():
        i = int(np.argmax(over))
        raise InvalidInputError(
            f"torque[{i}] = {torque[i]:.4g} N m is outside [{-arm.tau_max[i]:g}, {arm.tau_max[i]:g}]; "
            "give the joint torque last sent, in N m"
        )
    return torque


def checked_stiffness(value: Any, allowed: tuple[float, float]) -> np.ndarray:
    """Check a stiffness against its range, (6,), 1/s²; 0 lets a direction go."""
    return _checked_gain(value, "stiffness", "1/s²", allowed, free=True)


def checked_damping(value: Any, allowed: tuple[float, float]) -> np.ndarray:
    """Check a damping against its range, (6,), 1/s."""
    return _checked_gain(value, "damping", "1/s", allowed, free=False)


def _checked_gain(value: Any, name: str, unit: str, allowed: tuple[float, float], free: bool) -> np.ndarray:
    gain = finite_array(value, (6,), name)
    low, high = allowed
    outside = ((gain < low) | (gain > high)) & ~(free & (gain == 0.0))
    if outside.any():
        i = int(np.argmax(outside))
        raise InvalidInputError(
            f"{name}[{i}] = {gain[i]:g} {unit} is outside [{low:g}, {high:g}]{' and not 0' if free else ''}; "
            f"scale it or widen {name}_range of the ControllerConfig"
        )
    return gain


def shaped(value: Any, n: int, name: str) -> np.ndarray:
    """Check a measurement's shape only: numbers that are not finite are the tick's to refuse, the arm must not drop."""
    if type(value) is np.ndarray and value.dtype == float and value.shape == (n,):
        return value
    return array_of(value, (n,), name)


def seconds(value: Any) -> float:
    """Check a time to be one number, s."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidInputError(f"time is {type(value).__name__}, not a number; give seconds") from None


def numbers_of(target: Target) -> list:
    """Take down a target's numbers in whatever form is quickly compared: they may be changed in place."""
    pose = target.pose
    given = (pose.position, pose.quat, target.stiffness, target.damping, target.posture)
    return [value.tobytes() if type(value) is np.ndarray else _taken_down(value) for value in given]


def _taken_down(value: Any) -> Any:
    if value is None:
        return None
    return tuple(value) if isinstance(value, list | tuple) else np.asarray(value).tobytes()


def checked_slot(arm: Arm, records: np.ndarray | None, index: int) -> tuple[np.ndarray, int]:
    """Check where a controller is to live: an array of records, and the place in it."""
    if records is None:
        records = np.zeros(1, dtype=controller_dtype(arm.n))
    fits = isinstance(records, np.ndarray) and records.ndim == 1 and records.dtype == controller_dtype(arm.n)
    if not fits or not records.flags.writeable:
        raise InvalidInputError(
            f"records are no writable array of controllers for {arm.n} joints; "
            f"give numpy.zeros(how_many, dtype=controller_dtype({arm.n}))"
        )
    if not isinstance(index, int | np.integer) or not 0 <= index < len(records):
        raise InvalidInputError(f"index = {index!r} is no place in {len(records)} records; count from 0")
    return records, int(index)


def refuse_overload(load: Payload, loaded: Arm, gravity: np.ndarray, before: np.ndarray) -> None:
    """Refuse what the motors do not hold where the arm is, unless it is less than they are said to hold already.

    Args:
        load: that is to be carried.
        loaded: the arm with it.
        gravity, before: torques that hold the arm with it and without, (n,), N m.
    """
    need, needed = np.abs(gravity) / loaded.tau_max, np.abs(before) / loaded.tau_max
    over = (need > 1.0) & (need > needed)
    if over.any():
        i = int(np.argmax(need * over))
        raise InvalidInputError(
            f"mass = {load.mass:g} kg, {1000 * np.linalg.norm(load.com):.0f} mm from the tool point, asks "
            f"{need[i] * loaded.tau_max[i]:.4g} N m of joint '{loaded.model.joint(i).name}' here, which has "
            f"{loaded.tau_max[i]:g}; give what the arm can carry"
        )
