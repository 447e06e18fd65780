"""Pictures of the board for a robot: from a RealSense, or from one made of software before a simulated board."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from contactsafe.hardware.realsense import HEIGHT, WIDTH, ColourCamera, SoftwareCamera
from contactsafe.robot.arm import Arm
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.scene import build_plant
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.camera import camera_axes, plane_homography
from contactsafe.tasks.wiping.photograph import PHOTO_PX, Photographer, corners_of
from contactsafe.tasks.wiping.placed_camera import PlacedCamera
from contactsafe.tasks.wiping.robot_board import map_shown
from contactsafe.vision.lens import Distorted, Lens, Square, View
from contactsafe.vision.silhouette import on_plane

D455 = Lens(WIDTH, HEIGHT, 639.0, 639.0, 639.5, 359.5, (-0.056, 0.065, 0.0, 0.0, 0.0))
"""Colour pictures of a RealSense D455; three units read from 632 to 646 pixels of focal length, k1 −0.056, k2 0.065."""

_EVERY_TICKS = 33
"""Thirty pictures a second."""

_WAIT_MS = 200


def focal_px(camera: Camera) -> float:
    """Return the focal length of a photograph, pixels, of the camera that a policy was trained with."""
    return camera.focal_px * PHOTO_PX / camera.size


def camera_over(placed: PlacedCamera) -> Camera:
    """Return the upright camera at a calibrated one's place that looks at the board, and shows all of it."""
    board = placed.board
    x, y, z = placed.calibration.pose_base_camera[:3, 3].tolist()
    camera = replace(placed.camera, position=(x, y, z), target=board.centre)
    middle = camera.size / 2.0
    reach = np.abs(on_plane(corners_of(board), plane_homography(camera, board.centre[2])) - middle).max()
    return replace(camera, focal_px=camera.focal_px * middle / float(reach))


def turned_from(camera: Camera, placed: PlacedCamera) -> np.ndarray:
    """Return the axes of a calibrated camera in those of one at the same place, (3, 3)."""
    return camera_axes(camera).T @ placed.calibration.pose_base_camera[:3, :3]


def _opened(source: ColourCamera | None) -> ColourCamera:
    """Return a camera that was opened; asking for pictures before that is a mistake of the program."""
    if source is None:
        raise RuntimeError("the camera was not opened")
    return source


class CameraPictures:
    """Photographs of a RealSense camera as the policy's camera took them in training.

    Args:
        serial: of the camera; None for the first one.
        camera: that the policy was trained with.
        placed: where the RealSense was calibrated to stand; None where it stands where that camera was.
    """

    def __init__(self, serial: str | None, camera: Camera, placed: PlacedCamera | None = None):
        self._serial, self._camera, self._placed = serial, camera, placed
        self._source: ColourCamera | None = None

    def open(self) -> None:
        """Open it, and take over what its device knows of its lens."""
        self._source = source = ColourCamera(self._serial)
        source.open()
        lens = Lens.of_realsense(source.intrinsics)
        if self._placed is None:
            self._view: View = Square(lens, PHOTO_PX, focal_px(self._camera))
        else:
            self._placed.refuse_other(lens)
            self._view = self._placed.view()
        self._photo, self._number = np.zeros((PHOTO_PX, PHOTO_PX, 3), np.uint8), -1

    def latest(self, tick: int) -> tuple[np.ndarray, int, float]:
        """Return the newest photograph; one that is gone is looked for again."""
        del tick
        source = _opened(self._source)
        picture, number, age_ms = source.newest()
        if picture is None or age_ms > _WAIT_MS:
            source.look_again()
            return self._photo, self._number, math.inf if picture is None else age_ms
        if number != self._number:
            self._photo, self._number = self._view.cut(picture), number
        return self._photo, number, age_ms

    def close(self) -> None:
        """Let go of it."""
        if self._source is not None:
            self._source.close()


class PhotographedBoard:
    """A D455 made of software before the board of `WipedBoard`, read by the code that reads a real one.

    Args:
        path: of what the board shows.
        arm: that stands before it.
        board, camera: as they are.
        seed: of light and noise.
        placed: where the camera was calibrated to stand over that board; None for `camera` itself.
    """

    def __init__(
        self, path: Path, arm: Arm, board: BoardConfig, camera: Camera, seed: int, placed: PlacedCamera | None = None
    ):
        self._path, self._arm, self._board, self._seed, self._placed = path, arm, board, seed, placed
        self._camera = camera if placed is None else camera_over(placed)
        self._source: ColourCamera | None = None

    def open(self) -> None:
        """Map what the board shows, and start the camera."""
        self._shown = map_shown(self._path, self._board)
        self._photographer = Photographer(self._camera, self._board, build_plant(self._arm, WorldConfig(fixtures=())))
        lens = D455 if self._placed is None else self._placed.calibration.lens
        square = Square(lens, PHOTO_PX, focal_px(self._camera))
        turned = None if self._placed is None else turned_from(self._camera, self._placed)
        self._view = square if self._placed is None else self._placed.view()
        self._distorted = Distorted(square, turned)
        self._device = SoftwareCamera(lens.fx, lens.fy, lens.cx, lens.cy, lens.distortion)
        self._source = ColourCamera(sensor=self._device.sensor, profile=self._device.profile)
        self._source.open()
        self._photo, self._number = np.zeros((PHOTO_PX, PHOTO_PX, 3), np.uint8), -1

    def latest(self, tick: int) -> tuple[np.ndarray, int, float]:
        """Take a picture where the time for one has come, and return the newest."""
        number = tick // _EVERY_TICKS
        if number != self._number:
            shown = self._shown[0]
            solids = self._photographer.solids_at(shown["q"].copy())
            photograph = self._photographer.take(shown["cells"], solids, self._seed, number)
            self._device.give(self._distorted.picture(photograph), number, 1000.0 * number / 30.0)
            picture, self._number, _ = _opened(self._source).newest(_WAIT_MS)
            if picture is not None:
                self._photo = self._view.cut(picture)
        return self._photo, self._number, float(tick - number * _EVERY_TICKS)

    def close(self) -> None:
        """Stop the camera."""
        if self._source is not None:
            self._source.close()
