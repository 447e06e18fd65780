"""Pictures of the board for a robot, from a RealSense."""

import math

import numpy as np

from contactsafe.hardware.realsense import ColourCamera
from contactsafe.tasks.wiping.board import Camera
from contactsafe.tasks.wiping.photograph import PHOTO_PX
from contactsafe.tasks.wiping.placed_camera import PlacedCamera
from contactsafe.vision.lens import Lens, Square, View

_WAIT_MS = 200

UNDER_WAY_MS = 33.0
"""From exposure to arrival: taken for the time between two pictures; it has not been measured on a device."""


def focal_px(camera: Camera) -> float:
    """Return the focal length of a photograph, pixels, of the camera that a policy was trained with."""
    return camera.focal_px * PHOTO_PX / camera.size


def opened(source: ColourCamera | None) -> ColourCamera:
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

    def open(self, lockstep: bool = False) -> None:
        """Open it, and take over what its device knows of its lens."""
        del lockstep
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
        source = opened(self._source)
        picture, number, age_ms = source.newest()
        if picture is None or age_ms > _WAIT_MS:
            source.look_again()
            return self._photo, self._number, math.inf if picture is None else age_ms + UNDER_WAY_MS
        if number != self._number:
            self._photo, self._number = self._view.cut(picture), number
        return self._photo, number, age_ms + UNDER_WAY_MS

    def close(self) -> None:
        """Let go of it."""
        if self._source is not None:
            self._source.close()
