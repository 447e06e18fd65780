"""`contactsafe calibrate`: where a camera beside a robot stands, and where the target lay that it looked at."""

import datetime
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.parse import docstring, one_of, parse

if TYPE_CHECKING:
    from contactsafe.vision.camera_calibration import CameraCalibration
    from contactsafe.vision.charuco import CharucoTarget

PRINT, TOUCH, HAND_EYE = STEPS = ("print", "touch", "hand-eye")

_SAVE = {PRINT: Path("target.pdf"), TOUCH: Path("camera.json"), HAND_EYE: Path("camera.json")}
_NONE = tyro.conf.arg(help_behavior_hint="(default: none)")


@dataclass(frozen=True)
class Options:
    """What can be asked of a calibration.

    Attributes:
        step: print the target; or calibrate, the robot by touching the target or by showing it to the camera.
        save: file to write; target.pdf (or .png), or camera.json, which `contactsafe run` takes as
            --camera-calibration.
        camera: serial number of the RealSense; the first one found where it is not given.
        pictures: of the target as it lies, PNG or JPEG, instead of those of a RealSense now.
        intrinsics: focal lengths and principal point of those pictures, fx fy cx cy, pixels; where they are not given,
            the connected RealSense's.
        distortion: of those pictures, k1 k2 p1 p2 k3.
        count: pictures to take with a RealSense.
        robot: address of the Franka, to read its joints while you lead it by hand.
        touched: JSON file instead, {"A": [...], "B": [...], "C": [...]}: seven joint positions, rad, or x, y, z of the
            tip in the robot's base, m.
        corners: that are touched, three or four letters; a fourth shows how well it went.
        tool: what touches: hand, wiper, or flange.
        tip: x y z of the point that touches, in the tool's frame, m; where it is not given, the tool's own.
        poses: folder of the pictures of the target in the hand, with joints.json, {"01.png": [seven joint positions,
            rad], ...}; with --robot they are taken, and written there.
        square_mm: edge of a square as printed, mm; measure it.
        columns: squares of the target from left to right.
        rows: squares from top to bottom.
        json: print JSON.
    """

    step: Annotated[str, one_of(STEPS), tyro.conf.Positional]
    save: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: target.pdf, camera.json)")] = None
    camera: str | None = None
    pictures: tuple[Path, ...] = ()
    intrinsics: Annotated[tuple[float, float, float, float] | None, _NONE] = None
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    count: int = 10
    robot: str | None = None
    touched: Annotated[Path | None, _NONE] = None
    corners: str = "ABC"
    tool: str = "hand"
    tip: Annotated[tuple[float, float, float] | None, _NONE] = None
    poses: Annotated[Path | None, _NONE] = None
    square_mm: float = 36.0
    columns: int = 7
    rows: int = 5
    json: bool = False

    @property
    def path(self) -> Path:
        """File to write."""
        return self.save or _SAVE[self.step]

    def check(self) -> None:
        """Refuse what cannot be, before anything is read or asked."""
        if self.path.is_dir() or not self.path.parent.is_dir():
            raise InvalidInputError(f"{self.path} is no file that can be written; name one in a folder that is there")
        if self.intrinsics is not None and not self.pictures:
            raise InvalidInputError("intrinsics are for --pictures FILES; a RealSense knows its own")
        if not 1 <= self.count <= 100:
            raise InvalidInputError(f"count = {self.count}; give 1 to 100")
        if self.step == TOUCH and (self.robot is None) == (self.touched is None):
            raise InvalidInputError("give --robot ADDRESS to read the joints now, or --touched FILE with what was read")
        if self.step == TOUCH and (not set(self.corners) <= set("ABCD") or not 3 <= len(set(self.corners))):
            raise InvalidInputError(f"corners = {self.corners!r}; give three or four of the letters A, B, C, D")
        if self.step == HAND_EYE and self.poses is None:
            raise InvalidInputError("give --poses FOLDER: the pictures of the target in the hand, and joints.json")


def calibrate(arguments: Sequence[str]) -> None:
    """Find where a RealSense stands beside the robot, and where the place of work lies.

    Print the target, measure its squares, lay it flat in the middle of where the robot is to work, its edges along the
    robot's axes, and take pictures of it. Then the robot learns where it is: lead the closed finger tips by hand to the
    corners A, B, C of the pattern (`touch`), or clamp the target into the hand and show it from ten sides (`hand-eye`;
    afterwards it lies in its place again). Nothing is moved by the command.

      contactsafe calibrate print --square-mm 36
      contactsafe calibrate touch --robot 172.16.0.2 --tip 0 0 0.112
      contactsafe run --robot 172.16.0.2 --camera-calibration camera.json
    """
    asked = parse(Options, "contactsafe calibrate", arguments, description=docstring(calibrate))
    asked.check()
    from contactsafe.vision.charuco import CharucoTarget

    target = CharucoTarget(asked.columns, asked.rows, asked.square_mm / 1000.0)
    if asked.step == PRINT:
        _print(asked, target)
        return
    found = _found(asked, target)
    found.save(asked.path)
    said = [*lines_of(found), f"{'written':12s} {asked.path}; give it to run as --camera-calibration"]
    print(json.dumps(found.as_dict(), indent=1) if asked.json else "\n".join(said))


def _print(asked: Options, target: "CharucoTarget") -> None:
    from contactsafe.vision.sheet import write_sheet

    paper = write_sheet(target, asked.path)
    size = [1000.0 * edge for edge in target.extent]
    found = {"file": str(asked.path), "paper": paper, "square_mm": asked.square_mm, "size_mm": size}
    said = f"{asked.path}: {size[0]:g} × {size[1]:g} mm on {paper}; print at 100 %, then measure the squares"
    print(json.dumps(found, indent=1) if asked.json else said)


def _found(asked: Options, target: "CharucoTarget") -> "CameraCalibration":
    """Look at the target, find it by the robot, and put both together."""
    from contactsafe.cli.calibration_sources import Source, hand_eye_of, touched_of
    from contactsafe.vision.camera_calibration import CameraCalibration
    from contactsafe.vision.camera_pose import find_camera
    from contactsafe.vision.rigid import inverse
    from contactsafe.vision.touched import place_target

    with Source(asked) as source:
        robot: dict[str, float] = {}
        if asked.step == HAND_EYE:
            solved = hand_eye_of(asked, target, source)
            robot = {"residual_mm": 1000.0 * solved.residual_m, "residual_deg": float(np.degrees(solved.residual_rad))}
        seen = find_camera(target, source.lens, [target.find(picture) for picture in source.lying()])
        if asked.step == TOUCH:
            fit = place_target(target, touched_of(asked))
            robot = {"residual_mm": 1000.0 * fit.residual_m}
            pose_base_target, pose_base_camera = fit.pose, fit.pose @ seen.pose_target_camera
        else:
            pose_base_camera = solved.pose_base_camera
            pose_base_target = pose_base_camera @ inverse(seen.pose_target_camera)
        errors = {
            "reprojection_px": seen.error_px, "largest_px": seen.largest_px, "spread_mm": 1000.0 * seen.spread_m,
            "pictures": float(seen.pictures), "corners": float(seen.corners), **robot,
        }  # fmt: skip
        date = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
        lens, serial = source.lens, source.serial
    return CameraCalibration(lens, pose_base_camera, pose_base_target, serial, asked.step, errors, date)


def lines_of(found: "CameraCalibration") -> list[str]:
    """Return what a calibration says, for people, a line each."""
    lens, errors, target = found.lens, found.errors, found.pose_base_target
    tilt = np.degrees(np.arccos(np.clip(target[2, 2], -1.0, 1.0)))
    places = [", ".join(f"{x:.3f}" for x in pose[:3, 3]) for pose in (found.pose_base_camera, target)]
    turned = f" and {errors['residual_deg']:.2f}°" if "residual_deg" in errors else ""
    pictures = f"{errors.get('pictures', 0):.0f} with {errors.get('corners', 0):.0f} corners"
    return [
        f"{'camera':12s} {found.serial or 'of pictures'}, {lens.width} × {lens.height}, fx = {lens.fx:.1f} pixels; "
        f"calibrated {found.date or 'some day'} by {found.method or 'somebody'}",
        f"{'pictures':12s} {pictures}, reprojection error {errors.get('reprojection_px', np.nan):.2f} pixels, largest "
        f"{errors.get('largest_px', np.nan):.2f}; one picture alone says {errors.get('spread_mm', np.nan):.1f} mm else",
        f"{'robot':12s} residual {errors.get('residual_mm', np.nan):.2f} mm{turned}",
        f"{'stands':12s} at {places[0]} m in the robot's base",
        f"{'target':12s} its middle at {places[1]} m, tilted by {tilt:.2f}°",
    ]
