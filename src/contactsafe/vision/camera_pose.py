"""Where a camera stands before a calibration target, from pictures of it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.charuco import CharucoTarget, Corners
from contactsafe.vision.lens import Lens
from contactsafe.vision.opencv import cv2
from contactsafe.vision.rigid import angles, inverse, pose_of

LEAST_CORNERS = 8
"""Of a picture that counts."""

MOST_PX = 1.0
"""Root mean square of the reprojection error."""

_CLEARLY = 2.0
"""By which factor the mirrored pose of a plane must fit worse."""

_SAME_RAD = np.radians(2.0)
"""Two poses that are turned by less are one."""


class CameraPose(NamedTuple):
    """A camera before a target.

    Attributes:
        pose_target_camera: (4, 4); the camera's axes are right, down, forward.
        error_px: reprojection error, root mean square, pixels.
        largest_px: the largest one, pixels.
        spread_m: largest distance of the camera's place by one picture from that by all, m.
        pictures, corners: that counted.
    """

    pose_target_camera: np.ndarray
    error_px: float
    largest_px: float
    spread_m: float
    pictures: int
    corners: int


def find_camera(target: CharucoTarget, lens: Lens, seen: Sequence[Corners]) -> CameraPose:
    """Find the pose of a camera that stood still before a target that lay still.

    A plane has two poses that explain a picture nearly alike (Collins and Bartoli 2014, IPPE); both are refined, and
    the better one has to be clearly better.

    Args:
        target: in the pictures.
        lens: of the camera.
        seen: corners found in each picture.

    Raises:
        InvalidInputError: no picture shows enough corners, they do not fit together, or the pose is ambiguous.
    """
    good = [corners for corners in seen if _is_of_use(target, corners)]
    if not good:
        most = max((len(corners.ids) for corners in seen), default=0)
        raise InvalidInputError(
            f"no picture shows enough of the target: {most} corners at most, at least {LEAST_CORNERS} in several rows "
            f"and columns are needed; is it in view, sharp, large enough, and of {target.columns} × {target.rows} "
            "squares?"
        )
    everything = Corners(np.concatenate([one.ids for one in good]), np.concatenate([one.pixels for one in good]))
    found = _explaining(target, lens, everything)
    pose, away = found[0]
    alone = [_explaining(target, lens, one)[0] for one in good] if len(good) > 1 else found[:1]
    error = _rms(away)
    if error > MOST_PX:
        moved = len(good) > 1 and max(_rms(each[1]) for each in alone) <= MOST_PX
        why = "camera or target moved between the pictures" if moved else "is the lens this camera's, the paper flat?"
        raise InvalidInputError(
            f"the target's corners are {error:.2f} pixels from where they should be, allowed {MOST_PX:g}; {why}"
        )
    _refuse_ambiguous(found)
    camera, places = inverse(pose), np.array([inverse(each[0])[:3, 3] for each in alone])
    spread = float(np.linalg.norm(places - camera[:3, 3], axis=1).max())
    largest = float(np.linalg.norm(away, axis=1).max())
    return CameraPose(camera, error, largest, spread, len(good), len(everything.ids))


def _is_of_use(target: CharucoTarget, corners: Corners) -> bool:
    """Tell whether corners are enough, and span a plane."""
    if len(corners.ids) < LEAST_CORNERS:
        return False
    points = target.points(corners.ids)
    return bool(np.ptp(points, axis=0)[:2].min() > 0.5 * target.square_m)


def _explaining(target: CharucoTarget, lens: Lens, corners: Corners) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return poses of the target in the camera's frame, (4, 4), and what remains at each corner, (n, 2), pixels.

    The best one first.
    """
    points, pixels, distortion = target.points(corners.ids), corners.pixels, np.array(lens.distortion)
    _, turns, places, _ = cv2.solvePnPGeneric(points, pixels, lens.matrix, distortion, flags=cv2.SOLVEPNP_IPPE)
    found = []
    for turn, place in zip(turns, places, strict=True):
        turn, place = cv2.solvePnPRefineLM(points, pixels, lens.matrix, distortion, turn.copy(), place.copy())
        shown = cv2.projectPoints(points, turn, place, lens.matrix, distortion)[0].reshape(-1, 2)
        pose = pose_of(cv2.Rodrigues(turn)[0], place)
        if np.isfinite(pose).all() and inverse(pose)[2, 3] > 0.0:  # the camera sees the printed side
            found.append((pose, shown - pixels))
    if not found:
        raise InvalidInputError("no pose of a camera explains the target's corners; take sharper pictures")
    return sorted(found, key=lambda each: _rms(each[1]))


def _refuse_ambiguous(found: list[tuple[np.ndarray, np.ndarray]]) -> None:
    """Refuse two poses that are not one and explain the corners nearly alike."""
    best = found[0]
    for other in found[1:]:
        turned = float(angles(best[0][:3, :3].T @ other[0][:3, :3]))
        if turned > _SAME_RAD and _rms(other[1]) < _CLEARLY * _rms(best[1]):
            raise InvalidInputError(
                f"the pose is ambiguous: two that are {np.degrees(turned):.0f}° apart leave {_rms(best[1]):.2f} and "
                f"{_rms(other[1]):.2f} pixels; come nearer, or use a larger target"
            )


def _rms(away: np.ndarray) -> float:
    return float(np.sqrt((away**2).sum(axis=1).mean()))
