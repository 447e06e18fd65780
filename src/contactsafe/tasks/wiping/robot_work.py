"""Wiping on a real robot: pictures of the board become masks, as in training, and ink says when there is work."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from contactsafe.control.codes import FREE
from contactsafe.policy.action import DOWN
from contactsafe.policy.action_config import ActionConfig
from contactsafe.robot.arm import Arm, Pose
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.scene import build_plant
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.photograph import PHOTO_PX, Photographer
from contactsafe.tasks.wiping.placed_camera import PlacedCamera
from contactsafe.tasks.wiping.robot_goal import LEAST_PX, Goal
from contactsafe.vision.opencv import keep_to_one_thread
from contactsafe.vision.segment import Segmenter
from contactsafe.vision.silhouette import on_plane

_START_M = 0.06
"""Above the board's middle."""

_CLEAN_LOOKS, _INKED_LOOKS = 20, 6
"""New pictures in a row without ink, seen or last seen behind the arm, after which a board is clean; and with ink after
which there is work."""

_BLIND_MS = 150.0
"""The arm is held where the newest picture is older: it has stopped, or the camera is unplugged."""

_REMEMBERED = 30
"""Postures of the last half second."""

_AIR_LOOKS, _LEAST_AIR_LOOKS = 60, 20
"""Looks in the air, at rest, whose median is what the tool is taken to be pressed with there; and without which no work
begins."""

_STALLED_LOOKS = 150
"""New pictures, five seconds at full speed, without less ink than before after which the work is begun anew."""

_UNDECIDED_LOOKS = 60
"""The same after which the policy is shown one piece of ink alone: it may stand still between two that attract it
equally."""

_REST_M = 2e-4
"""A tool that moves by less between two looks is at rest."""

_SPECK_LOOKS = 90
"""Specks are no reason to begin. Work on nothing else, or on what was last seen where the arm is now, ends after so
many new pictures."""


class Pictures(Protocol):
    """What takes pictures of the board."""

    def open(self, lockstep: bool) -> None:
        """Begin, in the policy's process."""
        ...

    def latest(self, tick: int) -> tuple[np.ndarray, int, float]:
        """Return the newest picture, uint8 (455, 455, 3), its number, and its age, ms."""
        ...

    def close(self) -> None:
        """End."""
        ...


@dataclass
class WipingWork:
    """What the wiping task supplies for a real robot.

    Attributes:
        pictures: of the board.
        board, camera, action: as the policy was trained with.
        placed: camera and board where they were calibrated to be; None where they are as in training.
    """

    pictures: Pictures
    board: BoardConfig = field(default_factory=BoardConfig)
    camera: Camera = field(default_factory=Camera)
    action: ActionConfig = field(default_factory=ActionConfig)
    placed: PlacedCamera | None = None

    @property
    def centre(self) -> tuple[float, float, float]:
        """Middle of the board."""
        return self.board.centre if self.placed is None else self.placed.board.centre

    @property
    def start(self) -> Pose:
        """Above it."""
        return Pose(np.add(self.centre, [0.0, 0.0, _START_M]), DOWN)

    @property
    def travel_m_s(self) -> float:
        """As fast as a person would put a hand there."""
        return 0.15

    @property
    def homography(self) -> np.ndarray:
        """Of the masks, in the policy's frame: that of training, wherever camera and board are."""
        from contactsafe.tasks.wiping.camera import plane_homography

        return plane_homography(self.camera, self.board.centre[2])

    def prepare(self, arm: Arm, lockstep: bool, speed: float = 1.0) -> None:
        """Open the camera."""
        keep_to_one_thread()
        self._eye = Photographer(self.camera, self.board, build_plant(arm, WorldConfig(fixtures=())))
        self._view = None if self.placed is None else self.placed.view()
        corners = self._eye.corners if self.placed is None else self.placed.corners
        self._segmenter = Segmenter(self._eye.homography, corners, PHOTO_PX, self.camera.size)
        self._mask = np.full((self.camera.size, self.camera.size), 255, np.uint8)
        self._past: deque[tuple[float, np.ndarray]] = deque(maxlen=_REMEMBERED)
        self._left = np.zeros(self._mask.shape, bool)
        self._goal, self._speed, self._homography = Goal(), speed, self.homography
        self._number, self._age_ms, self._steps = -1, float("nan"), -1
        self._spotless, self._clean, self._inked = 0, 0, 0
        self._least_px, self._no_less, self._unfinished = math.inf, 0, False
        self._air: deque[np.ndarray] = deque(maxlen=_AIR_LOOKS)
        self._tare_n, self._was_at = np.zeros(3), np.zeros(3)
        self.pictures.open(lockstep)

    def look(self, seen: np.void, pose: np.ndarray, steps: int) -> dict[str, np.ndarray]:
        """Segment the newest picture; where the arm hides the board is known by its joints.

        Force is what is more than in the air, where the tool waited. Where the board was calibrated to lie elsewhere,
        the pose is given in the policy's frame. Where nothing gets done, the mask shows one piece of ink alone.
        """
        if steps < 0 <= self._steps:
            self._unfinished = not self.is_done()
        self._tare(seen, steps)
        picture, number, self._age_ms = self.pictures.latest(int(seen["tick"]))
        self._past.append((float(seen["tick"]), seen["q"].copy()))
        if number != self._number:
            self._number = number
            solids = self._eye.solids_at(self._posture_at(float(seen["tick"]) - self._age_ms))
            hidden = self._eye.hidden(solids) if self._view is None else self._view.hidden(solids)
            self._mask = self._segmenter.segment(picture, hidden)
            self._remember(self._segmenter.beside(hidden), steps)
            self._count(steps)
        if steps == 0:
            self._spotless, self._clean, self._unfinished = 0, 0, False
            self._goal.drop()
        self._steps = steps
        if self.placed is not None:
            pose = pose - np.array([*self.placed.shift, 0.0, 0.0, 0.0])
        is_undecided = steps > 0 and self._no_less > _UNDECIDED_LOOKS / self._speed
        mask = self._goal.show(self._mask, self._left, on_plane(pose[:2], self._homography), is_undecided)
        return {"mask": mask[..., None], "force": seen["force"] - self._tare_n, "pose": pose}

    def _remember(self, beside: np.ndarray, steps: int) -> None:
        """Take ink that the arm hides for what it was when last seen in this work, or in what was given up before."""
        hidden = ~beside if steps >= 0 or self._unfinished else np.zeros_like(beside)
        self._left = (self._mask == 0) | (self._left & hidden)

    def _count(self, steps: int) -> None:
        """Count new pictures with ink and without, and those since the least ink of this work was left."""
        shows, left = int(np.count_nonzero(self._mask == 0)) >= LEAST_PX, int(np.count_nonzero(self._left))
        self._spotless = 0 if left > 0 else self._spotless + 1
        self._clean = 0 if shows else self._clean + 1
        self._inked = self._inked + 1 if shows else 0
        less = left < self._least_px or steps <= 0
        self._least_px = left if less else self._least_px
        self._no_less = 0 if less else self._no_less + 1

    def _tare(self, seen: np.void, steps: int) -> None:
        """Remember the force in the air, as a force sensor is zeroed; a push of less than half a second is none."""
        rests = math.dist(seen["position"], self._was_at) < _REST_M
        self._was_at = seen["position"].copy()
        if steps < 0 and rests and seen["mode"] == FREE:
            self._air.append(seen["force"].copy())
        elif steps >= 0 and self._air:
            self._tare_n = np.median(self._air, axis=0)
            self._air.clear()

    def _posture_at(self, tick: float) -> np.ndarray:
        """Return where the joints were when a picture was taken, (n,), rad: the arm in it is where it was then."""
        ticks, postures = zip(*self._past, strict=True)
        if not np.isfinite(tick):
            return postures[-1]
        return np.array([np.interp(tick, ticks, joint) for joint in np.transpose(postures)])

    def is_blind(self) -> bool:
        """Tell whether the camera shows what is past."""
        return self._age_ms > _BLIND_MS

    def is_ready(self) -> bool:
        """Tell whether ink is seen, or work was given up before, and the force in the air is known."""
        return (self._inked >= _INKED_LOOKS or self._unfinished) and len(self._air) >= _LEAST_AIR_LOOKS

    def is_done(self) -> bool:
        """Tell whether no ink has been left for a while, or none been seen but specks for longer."""
        return self._spotless >= _CLEAN_LOOKS or self._clean >= _SPECK_LOOKS

    def is_stalled(self) -> bool:
        """Tell whether there has been no less ink for long: a policy that remembers nothing may go round in circles."""
        return self._no_less > _STALLED_LOOKS / self._speed

    def seen_with(self) -> tuple[float, int]:
        """Return the picture's age and how much ink its mask shows."""
        return self._age_ms, int(np.count_nonzero(self._mask == 0))

    def close(self) -> None:
        """Let go of the camera."""
        self.pictures.close()
