"""A camera that stands elsewhere than in training, over a board that lies elsewhere: both as the policy knows them.

The policy's frame is the robot's base, moved so that the board's middle is where it was in training. In that frame
photographs of the real camera become those of the training camera, by the homography of the board's plane.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.wiping.board import BoardConfig, Camera
from contactsafe.tasks.wiping.camera import plane_homography
from contactsafe.tasks.wiping.photograph import PHOTO_PX, corners_of, enlarged
from contactsafe.tasks.wiping.randomisation import Randomisation
from contactsafe.vision.camera_calibration import CameraCalibration
from contactsafe.vision.lens import Lens
from contactsafe.vision.plane_view import PlaneView
from contactsafe.vision.silhouette import on_plane

ASIDE_M, HEIGHT_M = 0.10, 0.05
"""By which the board's middle may lie aside of where it was in training, and above or below."""

TILT_RAD = math.hypot(*2 * [Randomisation.broad().board_tilt_rad[1]])
"""By which it may be tilted: as far as the shipped policy was trained with."""

TURNED_RAD = math.radians(20.0)
"""By which its edges may be turned from the robot's axes."""

_AROUND_M = 0.03
"""By which more than what may be wiped is looked at, on every side."""

ROUND_RAD = math.radians(30.0)
"""By which the camera may stand round the board from straight beyond it, where training had it: from further round the
arm hides what it is about to wipe. What the shipped policy cleans from where is in docs/howto/real_robot.md."""

LEAST_PX_M = 250.0
"""Pixels of the camera to a metre of the board, where it sees it most coarsely."""

_FOCAL_APART = 0.01
"""Fraction by which a device's focal length may differ from the calibrated one."""


@dataclass(frozen=True)
class PlacedCamera:
    """A calibrated camera over a calibrated board.

    Args:
        calibration: of both; the target lay in the board's middle, its edges along the board's.
        trained: the board of training.
        camera: of training.

    Raises:
        InvalidInputError: the board lies where the task cannot be done, or the camera does not see enough of it.
    """

    calibration: CameraCalibration
    trained: BoardConfig
    camera: Camera

    def __post_init__(self) -> None:
        """Refuse what the task cannot do."""
        aside, height = float(np.hypot(*self.shift[:2])), float(self.shift[2])
        if aside > ASIDE_M or abs(height) > HEIGHT_M:
            raise InvalidInputError(
                f"the board's middle is at {_words(self.board.centre)} m, {1000 * aside:.0f} mm aside and "
                f"{1000 * height:+.0f} mm high of {_words(self.trained.centre)}, allowed {1000 * ASIDE_M:g} and "
                f"{1000 * HEIGHT_M:g} mm; move it, and calibrate anew"
            )
        if self.tilt_rad > TILT_RAD:
            raise InvalidInputError(
                f"the board is tilted by {math.degrees(self.tilt_rad):.2f}°, allowed {math.degrees(TILT_RAD):.2f}°; "
                "level it, and calibrate anew"
            )
        if abs(self.turned_rad) > TURNED_RAD:
            raise InvalidInputError(
                f"the target is turned by {math.degrees(self.turned_rad):.0f}° from the robot's axes, allowed "
                f"{math.degrees(TURNED_RAD):.0f}°; lay it and the board along them, and calibrate anew"
            )
        if abs(self.round_rad) > ROUND_RAD:
            raise InvalidInputError(
                f"the camera stands {math.degrees(abs(self.round_rad)):.0f}° round the board from opposite the robot, "
                f"where training had it, allowed {math.degrees(ROUND_RAD):.0f}°: from there the arm hides what it is "
                "about to wipe; put it opposite the robot, and calibrate anew"
            )
        self._refuse_unseen()

    @property
    def board(self) -> BoardConfig:
        """Where the board lies, base."""
        x, y, z = self.calibration.pose_base_target[:3, 3].tolist()
        return replace(self.trained, centre=(x, y, z))

    @property
    def shift(self) -> np.ndarray:
        """From the board of training to this one, base, (3,), m."""
        return self.calibration.pose_base_target[:3, 3] - np.array(self.trained.centre)

    @property
    def tilt_rad(self) -> float:
        """Angle between the board's plane and the level."""
        return math.acos(min(1.0, float(self.calibration.pose_base_target[2, 2])))

    @property
    def turned_rad(self) -> float:
        """Angle from the robot's axes to the nearest edges of the target, about the vertical, within ± π/4."""
        x, y = self.calibration.pose_base_target[:2, 0]
        return (math.atan2(y, x) + math.pi / 4) % (math.pi / 2) - math.pi / 4

    @property
    def round_rad(self) -> float:
        """Angle about the vertical through the board's middle from the camera of training to this one, rad."""
        trained = np.array(self.camera.position[:2]) - np.array(self.trained.centre[:2])
        away = self.calibration.pose_base_camera[:2, 3] - np.array(self.board.centre[:2])
        across, along = trained[0] * away[1] - trained[1] * away[0], trained @ away
        return math.atan2(float(across), float(along))

    @property
    def corners(self) -> np.ndarray:
        """Of what is looked at of the board, in turn around it, policy's frame, (4, 2), m.

        All that may be wiped, and less than the board by more than a target lies askew: beyond its edge is no ink.
        """
        return corners_of(replace(self.trained, size=2 * (self.trained.ink_size + 2 * _AROUND_M,)))

    @property
    def plane(self) -> np.ndarray:
        """(x, y, 1) of the policy's frame, m, to the board's points in the base, m, (3, 3): its tilt lifts them."""
        normal = self.calibration.pose_base_target[:3, 2]
        slope = -normal[:2] / normal[2]
        lifted = [*slope, float(self.board.centre[2] - slope @ np.array(self.trained.centre[:2]))]
        return np.array([[1.0, 0.0, self.shift[0]], [0.0, 1.0, self.shift[1]], lifted])

    def view(self) -> PlaneView:
        """Return what turns pictures of this camera into photographs of the training camera."""
        homography = plane_homography(enlarged(self.camera), self.trained.centre[2])
        return PlaneView(self.calibration.lens, self.calibration.pose_base_camera, self.plane, homography, PHOTO_PX)

    def refuse_other(self, lens: Lens) -> None:
        """Refuse a device whose lens is not the one that was calibrated.

        Raises:
            InvalidInputError: it is not.
        """
        known = self.calibration.lens
        apart = max(abs(lens.fx / known.fx - 1.0), abs(lens.fy / known.fy - 1.0))
        if (lens.width, lens.height) != (known.width, known.height) or apart > _FOCAL_APART:
            raise InvalidInputError(
                f"the camera takes {lens.width} × {lens.height} pixels with fx = {lens.fx:.1f}, the calibrated one "
                f"{known.width} × {known.height} with fx = {known.fx:.1f}; calibrate this camera"
            )

    def _refuse_unseen(self) -> None:
        """Refuse a camera that does not see all that may be wiped, or too coarsely."""
        half = self.trained.ink_size / 2.0
        grid = np.linspace(-half, half, 13)
        places = np.array([[x, y] for x in grid for y in grid]) + np.array(self.trained.centre[:2])
        view = self.view()
        at = on_plane(places, plane_homography(enlarged(self.camera), self.trained.centre[2])).astype(int)
        seen = float((view.unseen[at[:, 1], at[:, 0]] == 0).mean())
        if seen < 1.0:
            raise InvalidInputError(
                f"the camera sees {100 * seen:.0f} % of the square of {self.trained.ink_size} m in the board's middle "
                "that is wiped, allowed 100 %; turn it to the middle or move it back, and calibrate anew"
            )
        coarsest = self._coarsest(places)
        if coarsest < LEAST_PX_M:
            raise InvalidInputError(
                f"the camera sees the board at {coarsest:.0f} pixels a metre where it is coarsest, allowed "
                f"{LEAST_PX_M:g} and more; put it nearer or higher, and calibrate anew"
            )

    def _coarsest(self, places: np.ndarray) -> float:
        """Return the fewest pixels to a metre at places of the plane, (n, 2), in the direction that is seen worst."""
        pose, lens = self.calibration.pose_base_camera, self.calibration.lens
        onto = np.diag([lens.fx, lens.fy, 1.0]) @ pose[:3, :3].T
        H = onto @ (self.plane - np.outer(pose[:3, 3], [0.0, 0.0, 1.0]))
        step = 1e-4
        along = [(on_plane(places + step * axis, H) - on_plane(places, H)) / step for axis in np.eye(2)]
        return float(np.linalg.svd(np.stack(along, axis=-1), compute_uv=False)[:, -1].min())


def _words(place: tuple[float, float, float]) -> str:
    return ", ".join(f"{value:.3f}" for value in place)
