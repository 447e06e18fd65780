"""What identification found of one robot, as a file: losses at its joints, rotors, payload, sensors."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.core.files import write_whole
from contactsafe.robot.friction import joint_drag
from contactsafe.robot.payload import Payload

FORMAT = "contactsafe calibration 1"

_MOST = 1_000_000
"""Bytes of a file: a larger one is no calibration."""


@dataclass(frozen=True)
class Losses:
    """Torque of each joint that is lost, or shown beside what drives the links, as it depends on velocity.

    bias + viscous · q̇ + dry · tanh(½ `DRY_STEEP` q̇) + smooth · (tanh(½ steep (q̇ + shift)) − tanh(½ steep shift)).

    Attributes:
        bias: at rest, (n,), N m.
        viscous: per velocity, (n,), N m s/rad.
        dry: dry friction in motion, (n,), N m.
        smooth: friction of the published form, (n,), N m.
        steep: how soon that is there, (n,), s/rad.
        shift: of its step, (n,), rad/s.
    """

    bias: np.ndarray
    viscous: np.ndarray
    dry: np.ndarray
    smooth: np.ndarray
    steep: np.ndarray
    shift: np.ndarray

    @property
    def coulomb(self) -> np.ndarray:
        """Return all friction but the viscous one, of a joint that is fast, (n,), N m."""
        return self.dry + self.smooth

    @property
    def friction(self) -> np.ndarray:
        """Return the smooth step as φ1, φ2, φ3 of `contactsafe.robot.friction`, (n, 3)."""
        return np.stack([2.0 * self.smooth, self.steep, self.shift], axis=1)

    @property
    def drag(self) -> np.ndarray:
        """Return what is viscous, constant and dry, as in `Arm.drag`, (n, 3)."""
        return np.stack([self.viscous, self.bias, self.dry], axis=1)

    def at(self, qd: np.ndarray) -> np.ndarray:
        """Return the torque at joint velocities qd (n,), rad/s: (n,), N m."""
        return joint_drag(self.friction, self.drag, qd)


@dataclass(frozen=True)
class Calibration:
    """What was identified of one robot; what a log did not show is None, and stays the description's.

    Attributes:
        robot: name of the arm.
        tool: name of what its flange carried, empty where nobody says; a payload counts for it alone.
        losses: between command and links, friction of motors and gears above all; None without a log of commands.
        rotor: inertia of the rotors seen at the joints, (n,), kg m²; None likewise.
        stiction: torque that holds a joint at rest, (n,), N m; NaN where no log shows it.
        sensor: what torque sensors behind the gears show beside what drives the links; None without a log of them.
        payload: carried beside what the description has, in the tool's frame; its mass may be negative. None for none.
        torque_noise: of what was logged, standard deviation, (n,), N m.
        velocity_noise: likewise, (n,), rad/s.
        source: the log.

    Raises:
        InvalidInputError: numbers that are not one a joint, or not finite; negative noise or stiction.
    """

    robot: str
    tool: str
    torque_noise: np.ndarray
    velocity_noise: np.ndarray
    stiction: np.ndarray
    losses: Losses | None = None
    rotor: np.ndarray | None = None
    sensor: Losses | None = None
    payload: Payload | None = None
    source: str = ""

    def __post_init__(self) -> None:
        """Refuse what is no calibration of n joints."""
        for name, values in self._arrays().items():
            if values.shape != (self.n,):
                raise InvalidInputError(f"calibration: {name} has shape {values.shape}; give {self.n} numbers")
            if not (np.isfinite(values) | (name == "stiction") & np.isnan(values)).all():
                raise InvalidInputError(f"calibration: {name} has a number that is not finite; identify anew")
            if name in ("torque_noise", "velocity_noise", "stiction") and (values < 0.0).any():
                raise InvalidInputError(f"calibration: {name} has a negative number; identify anew")
        load = () if self.payload is None else (self.payload.mass, *self.payload.com, *np.ravel(self.payload.inertia))
        if not np.isfinite(load).all() or len(load) not in (0, 13):
            raise InvalidInputError("calibration: payload is not a mass, a centre and a finite tensor; identify anew")

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.torque_noise)

    def _arrays(self) -> dict[str, np.ndarray]:
        found = {name: getattr(self, name) for name in ("torque_noise", "velocity_noise", "stiction")}
        if self.rotor is not None:
            found["rotor"] = self.rotor
        for part in ("losses", "sensor"):
            losses = getattr(self, part)
            found |= {} if losses is None else {f"{part}.{name}": values for name, values in vars(losses).items()}
        return found

    def save(self, path: str | Path) -> None:
        """Write it as JSON, whole or not at all.

        Raises:
            OutputError: it cannot be written.
        """
        write_whole(Path(path), (json.dumps(self.as_dict(), indent=1, allow_nan=False) + "\n").encode())

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON; names end in units."""
        load = self.payload
        return {
            "format": FORMAT,
            "robot": self.robot,
            "tool": self.tool,
            "source": self.source,
            "torque_noise_nm": self.torque_noise.tolist(),
            "velocity_noise_rad_s": self.velocity_noise.tolist(),
            "stiction_nm": [value if math.isfinite(value) else None for value in self.stiction.tolist()],
            "losses": _losses_to(self.losses),
            "rotor_kg_m2": None if self.rotor is None else self.rotor.tolist(),
            "sensor": _losses_to(self.sensor),
            "payload": None
            if load is None
            else {"mass_kg": load.mass, "com_m": load.com.tolist(), "inertia_kg_m2": load.inertia.tolist()},
        }

    @classmethod
    def load(cls, path: str | Path) -> "Calibration":
        """Read what `save` wrote.

        Raises:
            InvalidInputError: there is no such file, or it is no calibration.
        """
        path = Path(path)
        try:
            with path.open("rb") as file:
                text = file.read(_MOST + 1)
        except OSError as error:
            what = f"{path} cannot be read: {error.strerror or error}"
            raise InvalidInputError(f"{what}; give what `contactsafe identify --save` wrote") from None
        try:
            found = json.loads(text) if len(text) <= _MOST else None
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise InvalidInputError(f"{path.name} is no calibration; give what `contactsafe identify` wrote")
        try:
            return _from_dict(found)
        except (LookupError, TypeError, ValueError, OverflowError) as error:
            if isinstance(error, InvalidInputError):
                raise
            raise InvalidInputError(
                f"{path.name} is a damaged calibration: {shown(str(error))}; identify anew"
            ) from None


_UNITS = {
    "bias": "bias_nm", "viscous": "viscous_nm_s_rad", "dry": "dry_nm", "smooth": "smooth_nm", "steep": "steep_s_rad",
    "shift": "shift_rad_s",
}  # fmt: skip


def _losses_to(losses: Losses | None) -> dict[str, list[float]] | None:
    return None if losses is None else {_UNITS[name]: values.tolist() for name, values in vars(losses).items()}


def _losses_from(found: dict | None) -> Losses | None:
    return None if found is None else Losses(**{name: _vector(found[unit]) for name, unit in _UNITS.items()})


def _from_dict(found: dict[str, Any]) -> Calibration:
    load = found["payload"]
    return Calibration(
        robot=str(found["robot"]),
        tool=str(found["tool"]),
        torque_noise=_vector(found["torque_noise_nm"]),
        velocity_noise=_vector(found["velocity_noise_rad_s"]),
        stiction=_vector([math.nan if value is None else value for value in found["stiction_nm"]]),
        losses=_losses_from(found["losses"]),
        rotor=None if found["rotor_kg_m2"] is None else _vector(found["rotor_kg_m2"]),
        sensor=_losses_from(found["sensor"]),
        payload=None
        if load is None
        else Payload(
            float(load["mass_kg"]),
            _vector(load["com_m"]).reshape(3),
            np.array(load["inertia_kg_m2"], dtype=float).reshape(3, 3),
        ),
        source=str(found["source"]),
    )


def _vector(values: Any) -> np.ndarray:
    return np.array(values, dtype=float).reshape(-1)
