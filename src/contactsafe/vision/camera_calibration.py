"""What calibration found of a camera beside a robot, as a file: its lens, where it stands, and where the target lay."""

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.core.files import write_whole
from contactsafe.core.rotation import matrix_to_quat, quat_to_matrix
from contactsafe.vision.lens import Lens
from contactsafe.vision.rigid import inverse, pose_of

FORMAT = "contactsafe camera calibration 1"

_MOST = 100_000
"""Bytes of a file: a larger one is no calibration of a camera."""

_LOWEST_M = 0.1
"""Of the camera above the target's plane."""


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """A camera that stands beside a robot.

    Attributes:
        lens: of the camera.
        pose_base_camera: where it stands in the robot's base, axes right, down, forward, (4, 4).
        pose_base_target: where the target's middle lay, z out of the printed side, (4, 4).
        serial: of the camera, empty where nobody says.
        method: how the robot came in: touch or hand-eye.
        errors: what remained, by name and unit.
        date: when, ISO 8601.

    Raises:
        InvalidInputError: poses that are none, or a camera that is not above what it looks at.
    """

    lens: Lens
    pose_base_camera: np.ndarray
    pose_base_target: np.ndarray
    serial: str = ""
    method: str = ""
    errors: dict[str, float] = field(default_factory=dict)
    date: str = ""

    def __post_init__(self) -> None:
        """Refuse what no camera can be."""
        for name in ("pose_base_camera", "pose_base_target"):
            pose = np.asarray(getattr(self, name), dtype=float)
            if pose.shape != (4, 4) or not np.isfinite(pose).all() or not _is_pose(pose):
                raise InvalidInputError(f"camera calibration: {name} is no pose; calibrate anew")
            object.__setattr__(self, name, pose)
        height = (inverse(self.pose_base_target) @ self.pose_base_camera)[2, 3]
        if not height > _LOWEST_M:
            raise InvalidInputError(
                f"camera calibration: the camera is {height:.2f} m above the target's plane, allowed {_LOWEST_M} m and "
                "more; calibrate anew"
            )
        if not np.isfinite(list(self.errors.values())).all():
            raise InvalidInputError("camera calibration: an error is not a finite number; calibrate anew")

    def save(self, path: str | Path) -> None:
        """Write it as JSON, whole or not at all.

        Raises:
            OutputError: it cannot be written.
        """
        write_whole(Path(path), (json.dumps(self.as_dict(), indent=1, allow_nan=False) + "\n").encode())

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON; quaternions are w x y z."""
        return {
            "format": FORMAT,
            "date": self.date,
            "method": self.method,
            "serial": self.serial,
            "lens": dataclasses.asdict(self.lens),
            "pose_base_camera": _pose_to(self.pose_base_camera),
            "pose_base_target": _pose_to(self.pose_base_target),
            "errors": self.errors,
        }

    @classmethod
    def load(cls, path: str | Path) -> "CameraCalibration":
        """Read what `save` wrote.

        Raises:
            InvalidInputError: there is no such file, or it is no calibration of a camera.
        """
        path = Path(path)
        try:
            with path.open("rb") as file:
                text = file.read(_MOST + 1)
        except OSError as error:
            raise InvalidInputError(
                f"{path} cannot be read: {error.strerror or error}; give what `contactsafe calibrate` wrote"
            ) from None
        try:
            found = json.loads(text) if len(text) <= _MOST else None
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise InvalidInputError(f"{path.name} is no camera calibration; give what `contactsafe calibrate` wrote")
        try:
            return _from_dict(found)
        except (LookupError, TypeError, ValueError, OverflowError, AttributeError) as error:
            if isinstance(error, InvalidInputError):
                raise
            raise InvalidInputError(
                f"{path.name} is a damaged camera calibration: {shown(str(error))}; calibrate anew"
            ) from None


def _is_pose(pose: np.ndarray) -> bool:
    R = pose[:3, :3]
    turned = np.allclose(R @ R.T, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0.0
    return bool(turned and np.allclose(pose[3], [0.0, 0.0, 0.0, 1.0]))


def _pose_to(pose: np.ndarray) -> dict[str, list[float]]:
    return {"position_m": pose[:3, 3].tolist(), "quat": matrix_to_quat(np.ascontiguousarray(pose[:3, :3])).tolist()}


def _pose_from(found: dict[str, Any]) -> np.ndarray:
    quat = np.array(found["quat"], dtype=float).reshape(4)
    return pose_of(quat_to_matrix(quat), np.array(found["position_m"], dtype=float).reshape(3))


def _from_dict(found: dict[str, Any]) -> CameraCalibration:
    lens = found["lens"]
    fx, fy, cx, cy = (float(lens[name]) for name in ("fx", "fy", "cx", "cy"))
    k1, k2, p1, p2, k3 = (float(number) for number in lens["distortion"])
    return CameraCalibration(
        lens=Lens(int(lens["width"]), int(lens["height"]), fx, fy, cx, cy, (k1, k2, p1, p2, k3)),
        pose_base_camera=_pose_from(found["pose_base_camera"]),
        pose_base_target=_pose_from(found["pose_base_target"]),
        serial=str(found["serial"]),
        method=str(found["method"]),
        errors={str(name): float(value) for name, value in found["errors"].items()},
        date=str(found["date"]),
    )
