"""What a calibration is made of: pictures, a lens, joint positions; from devices now, or from files."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactsafe.cli.arms import arm_of
from contactsafe.core.copying import Unique
from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.core.files import write_whole
from contactsafe.core.rotation import quat_to_matrix
from contactsafe.hardware.franka_port import FrankaPort
from contactsafe.hardware.messages import reading_dtype
from contactsafe.hardware.realsense import CameraError, ColourCamera
from contactsafe.robot import robots
from contactsafe.robot.arm import Arm
from contactsafe.vision.camera_pose import find_camera
from contactsafe.vision.charuco import CharucoTarget
from contactsafe.vision.hand_eye import HandEye, solve_hand_eye
from contactsafe.vision.lens import Lens
from contactsafe.vision.picture_file import read_picture, write_picture
from contactsafe.vision.rigid import inverse, pose_of

if TYPE_CHECKING:
    from contactsafe.cli.calibrate import Options

JOINTS = "joints.json"

_MOST = 1_000_000  # bytes of a file of joint positions
_WAIT_MS, _TRIES = 500, 10
_STILL_RAD_S = 0.05


class Source(Unique):
    """A RealSense, or pictures from files; a context.

    Attributes:
        lens: of the pictures.
        serial: of the camera; empty where it is not known.
    """

    _why = "a camera is read once; open another one"

    def __init__(self, asked: "Options"):
        self._asked = asked
        self._camera: ColourCamera | None = None
        self._pictures = [read_picture(path) for path in asked.pictures]
        sizes = {picture.shape for picture in self._pictures}
        if len(sizes) > 1:
            raise InvalidInputError(f"pictures of {len(sizes)} sizes; give those of one camera")
        self.serial = asked.camera or ""
        if asked.intrinsics is not None:
            height, width, _ = self._pictures[0].shape
            self.lens = Lens(width, height, *asked.intrinsics, asked.distortion)
        else:
            self.lens = self._open()

    def _open(self) -> Lens:
        self._camera = camera = ColourCamera(self._asked.camera)
        camera.open()
        self.serial = camera.serial
        lens = Lens.of_realsense(camera.intrinsics)
        if self._pictures and self._pictures[0].shape[:2] != (lens.height, lens.width):
            raise InvalidInputError("pictures are not of the connected camera's size; say their --intrinsics")
        return lens

    def __enter__(self) -> "Source":
        """Begin."""
        return self

    def __exit__(self, *error: object) -> None:
        """Let go of the camera."""
        if self._camera is not None:
            self._camera.close()

    def lying(self) -> list[np.ndarray]:
        """Return pictures of the target as it lies."""
        if self._pictures:
            return self._pictures
        if self._asked.robot is not None:
            ask("Lay the target in its place, lead the arm out of the picture, and press Enter: ")
        return [self.take() for _ in range(self._asked.count)]

    def take(self) -> np.ndarray:
        """Return a picture that the camera takes now.

        Raises:
            CameraError: none comes.
        """
        if self._camera is None:
            raise InvalidInputError("pictures in the hand are taken with a RealSense; leave out --intrinsics")
        _, before, _ = self._camera.newest()
        for _ in range(_TRIES):
            picture, number, _ = self._camera.newest(_WAIT_MS)
            if picture is not None and number != before:
                return picture.copy()
        raise CameraError("the camera shows nothing new; plug it in again (USB 3), and start anew")


def ask(text: str) -> str:
    """Ask a person, on stderr; return the answer in lower case.

    Raises:
        InvalidInputError: nobody answers.
    """
    print(text, end="", file=sys.stderr, flush=True)
    try:
        return input().strip().lower()
    except EOFError:
        raise InvalidInputError("nobody answers; run it in a terminal, or give files of what was read") from None


def read_joints(address: str, n: int) -> np.ndarray:
    """Return the joint positions of a robot at rest, (n,), rad; it is told nothing.

    Raises:
        InvalidInputError: it moves.
        RobotError: it cannot be reached.
    """
    port, reading = FrankaPort(address), np.zeros(1, reading_dtype(n))
    try:
        port.reach()
        port.look(reading)
    finally:
        port.close()
    if np.abs(reading["qd"]).max() > _STILL_RAD_S:
        raise InvalidInputError("the arm moves; hold it still while its joints are read")
    return reading["q"][0].copy()


def touched_of(asked: "Options") -> dict[str, np.ndarray]:
    """Return where the tip was at each corner, (3,), m, in the robot's base."""
    arm = _arm(asked)
    if asked.touched is not None:
        return {str(name): _place(arm, values, name) for name, values in _read(asked.touched).items()}
    found = {}
    for letter in asked.corners:
        ask(f"Lead the tip to corner {letter} of the pattern, let go, and press Enter: ")
        found[letter] = arm.tool_pose(read_joints(str(asked.robot), arm.n)).position
        print(f"  {letter} at {', '.join(f'{x:.4f}' for x in found[letter])} m", file=sys.stderr)
    return found


def hand_eye_of(asked: "Options", target: CharucoTarget, source: Source) -> HandEye:
    """Return the camera's pose from the pictures of the target in the hand; refuse what tells none."""
    folder = Path(str(asked.poses))
    arm = arm_of("fr3", "flange", None)
    if asked.robot is not None:
        _collect(str(asked.robot), arm, source, folder)
    hands, targets, missed = [], [], []
    for name, values in _read(folder / JOINTS).items():
        corners = target.find(read_picture(folder / name))
        try:
            seen = find_camera(target, source.lens, [corners])
        except InvalidInputError:
            missed.append(name)
            continue
        pose = arm.tool_pose(arm.joint_vector(values, f"{JOINTS}: {name}"))
        hands.append(pose_of(quat_to_matrix(pose.quat), pose.position))
        targets.append(inverse(seen.pose_target_camera))
    if missed:
        print(f"not used, the target is not seen well enough: {', '.join(missed)}", file=sys.stderr)
    if len(hands) < 3:
        raise InvalidInputError(f"{len(hands)} pictures in {folder} show the target well; give three or more")
    return solve_hand_eye(np.array(hands), np.array(targets))


def _collect(address: str, arm: Arm, source: Source, folder: Path) -> None:
    """Take pictures of the target in the hand while a person leads the arm; write them as they come."""
    folder.mkdir(parents=True, exist_ok=True)
    found: dict[str, list[float]] = {}
    while ask(f"Show the target from side {len(found) + 1}, let go, and press Enter; q ends: ") != "q":
        q, name = read_joints(address, arm.n), f"{len(found) + 1:02d}.png"
        write_picture(folder / name, source.take())
        found[name] = q.tolist()
        write_whole(folder / JOINTS, (json.dumps(found, indent=1) + "\n").encode())


def _arm(asked: "Options") -> Arm:
    """Return the arm with the point that touches."""
    arm = arm_of("fr3", asked.tool, None)
    return arm if asked.tip is None or arm.tool is None else robots.fr3(replace(arm.tool, tcp=asked.tip))


def _place(arm: Arm, values: Any, name: str) -> np.ndarray:
    """Return a tip's position, (3,), m, from itself or from joint positions."""
    length = len(values) if isinstance(values, list) else 0
    if length not in (3, arm.n):
        raise InvalidInputError(
            f"corner {shown(name)} has {shown(values)}; give x, y, z, m, or {arm.n} joint positions, rad"
        )
    try:
        numbers = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInputError(f"corner {shown(name)} has {shown(values)}; give numbers") from None
    return numbers if length == 3 else arm.tool_pose(numbers).position


def _read(path: Path) -> dict[str, Any]:
    """Read a JSON object of lists."""
    try:
        with path.open("rb") as file:
            text = file.read(_MOST + 1)
    except OSError as error:
        raise InvalidInputError(f"{path} cannot be read: {error.strerror or error}; see --help for its form") from None
    try:
        found = json.loads(text) if len(text) <= _MOST else None
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise InvalidInputError(f"{path.name} is no JSON object; see contactsafe calibrate --help for its form")
    return found
