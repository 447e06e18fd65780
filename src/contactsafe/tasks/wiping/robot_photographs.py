"""A RealSense D455 made of software before a simulated board, read by the code that reads a real one.

By the clock its pictures are drawn in a process of their own, as a camera takes its own; in lockstep they are drawn
where they are read, each of its tick.
"""

import multiprocessing
import os
import time
from dataclasses import dataclass, replace
from multiprocessing.process import BaseProcess
from pathlib import Path

import numpy as np

from contactsafe.core.process import ignore_terminal
from contactsafe.hardware.realsense import HEIGHT, WIDTH, CameraError, ColourCamera, SoftwareCamera
from contactsafe.robot.arm import Arm
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.scene import build_plant
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.camera import camera_axes, plane_homography
from contactsafe.tasks.wiping.photograph import PHOTO_PX, Photographer, corners_of
from contactsafe.tasks.wiping.placed_camera import PlacedCamera
from contactsafe.tasks.wiping.robot_board import map_shown
from contactsafe.tasks.wiping.robot_pictures import focal_px, opened
from contactsafe.vision.lens import Distorted, Lens, Square, View
from contactsafe.vision.opencv import keep_to_one_thread
from contactsafe.vision.silhouette import on_plane

D455 = Lens(WIDTH, HEIGHT, 639.0, 639.0, 639.5, 359.5, (-0.056, 0.065, 0.0, 0.0, 0.0))
"""Colour pictures of a RealSense D455; three units read from 632 to 646 pixels of focal length, k1 −0.056, k2 0.065."""

_EVERY_TICKS = 33
"""Thirty pictures a second."""

_GIVES_WAY = 10
"""By which whoever draws is nicer than control and policy: a real camera takes nothing from their processors."""

_WAIT_MS = 200
_READY_S = 120.0
_NAP_S = 0.002


@dataclass(frozen=True)
class Subject:
    """What a software camera is before.

    Attributes:
        path: of what the board shows.
        arm: that stands before it.
        board, camera: as they are.
        seed: of light and noise.
        placed: where the camera was calibrated to stand over that board; None for `camera` itself.
    """

    path: Path
    arm: Arm
    board: BoardConfig
    camera: Camera
    seed: int
    placed: PlacedCamera | None = None

    @property
    def lens(self) -> Lens:
        """Of the camera."""
        return D455 if self.placed is None else self.placed.calibration.lens

    def view(self) -> View:
        """Return what brings its pictures to the policy's view."""
        return Square(self.lens, PHOTO_PX, focal_px(self.camera)) if self.placed is None else self.placed.view()


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


class Drawing:
    """What the camera sees of the board, and of the arm before it.

    Args:
        subject: as given.
    """

    def __init__(self, subject: Subject):
        self.shown, self._seed, placed = map_shown(subject.path, subject.board), subject.seed, subject.placed
        camera = subject.camera if placed is None else camera_over(placed)
        self._photographer = Photographer(camera, subject.board, build_plant(subject.arm, WorldConfig(fixtures=())))
        turned = None if placed is None else turned_from(camera, placed)
        self._distorted = Distorted(Square(subject.lens, PHOTO_PX, focal_px(camera)), turned)

    def picture(self, number: int) -> np.ndarray:
        """Return picture number so and so, uint8 (720, 1280, 3), of now."""
        shown = self.shown[0]
        solids = self._photographer.solids_at(shown["q"].copy())
        return self._distorted.picture(self._photographer.take(shown["cells"], solids, self._seed, number))


def draw_pictures(subject: Subject) -> None:
    """Be the camera of a run, in a process of its own, until whoever began it has ended."""
    ignore_terminal()
    keep_to_one_thread()
    os.nice(_GIVES_WAY)
    parent, drawing, number, slot = os.getppid(), Drawing(subject), -1, 0
    shown = drawing.shown[0]
    while os.getppid() == parent:
        now = int(shown["tick"]) // _EVERY_TICKS
        if now == number:
            time.sleep(_NAP_S)
            continue
        number, slot = now, 1 - slot
        shown["taken"][slot], shown["taken_tick"][slot] = 0, shown["tick"]
        shown["pictures"][slot] = drawing.picture(number)
        shown["taken"][slot] = number + 1


class PhotographedBoard:
    """The camera's pictures of the board of `WipedBoard`.

    Args:
        path, arm, board, camera, seed, placed: as `Subject` has them.
    """

    def __init__(
        self, path: Path, arm: Arm, board: BoardConfig, camera: Camera, seed: int, placed: PlacedCamera | None = None
    ):
        self._subject = Subject(path, arm, board, camera, seed, placed)
        self._source: ColourCamera | None = None
        self._process: BaseProcess | None = None

    def open(self, lockstep: bool = True) -> None:
        """Map what the board shows, and start the camera.

        Raises:
            CameraError: its process did not get ready.
        """
        subject, lens = self._subject, self._subject.lens
        self._drawing = Drawing(subject) if lockstep else None
        self._shown, self._view = map_shown(subject.path, subject.board), subject.view()
        self._device = SoftwareCamera(lens.fx, lens.fy, lens.cx, lens.cy, lens.distortion)
        self._source = ColourCamera(sensor=self._device.sensor, profile=self._device.profile)
        self._source.open()
        self._photo, self._number, self._tick = np.zeros((PHOTO_PX, PHOTO_PX, 3), np.uint8), -1, 0
        if not lockstep:
            self._begin()

    def _begin(self) -> None:
        """Start the process that draws, and wait for its first picture."""
        self._process = process = multiprocessing.get_context("spawn").Process(
            target=draw_pictures, args=(self._subject,), daemon=True
        )
        process.start()
        until = time.monotonic() + _READY_S
        while not self._shown["taken"].any():
            if not process.is_alive() or time.monotonic() > until:
                raise CameraError("the process that draws the camera's pictures did not get ready; it said why above")
            time.sleep(_NAP_S)

    def latest(self, tick: int) -> tuple[np.ndarray, int, float]:
        """Return the newest picture; in lockstep it is taken where the time for one has come.

        By the clock its age is counted in the simulator's ticks: control has fewer, by the states that it lost.
        """
        now = tick if self._drawing else int(self._shown["tick"][0])
        number = tick // _EVERY_TICKS if self._drawing else int(self._shown["taken"].max()) - 1
        if number > self._number:
            self._take(number, tick)
        return self._photo, self._number, float(now - self._tick)

    def _take(self, number: int, tick: int) -> None:
        """Hand a picture to the device, and take it from there as that of a real one."""
        slot = int(self._shown["taken"][0].argmax())
        taken = tick if self._drawing else int(self._shown["taken_tick"][0, slot])
        picture = self._drawing.picture(number) if self._drawing else self._shown["pictures"][0, slot].copy()
        if not self._drawing and self._shown["taken"][0, slot] != number + 1:
            return  # the next one was drawn into it meanwhile
        self._device.give(picture, number, 1000.0 * number / 30.0)
        self._tick = taken
        picture, self._number, _ = opened(self._source).newest(_WAIT_MS)
        if picture is not None:
            self._photo = self._view.cut(picture)

    def close(self) -> None:
        """Stop the camera."""
        if self._source is not None:
            self._source.close()
        if self._process is not None:
            self._process.kill()
            self._process.join()
