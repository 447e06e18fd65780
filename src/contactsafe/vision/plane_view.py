"""A plane as another camera would see it: from the picture of one that stands elsewhere, by the plane's homography.

What lies in the plane comes out as that camera would see it. What stands before the plane does not: where it hides the
plane is found from where the camera really stands.
"""

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.checks import checked_homography
from contactsafe.vision.lens import Lens, View
from contactsafe.vision.opencv import cv2
from contactsafe.vision.rigid import inverse
from contactsafe.vision.silhouette import Solids, silhouette

_NEAR_M = 0.05
"""A plane that comes nearer to the camera is taken for one behind it."""

_OUTSIDE = -1e4  # pixels: where no picture is


class PlaneView(View):
    """The photograph of a plane that another camera would take.

    Args:
        lens: of the camera that takes the pictures.
        pose_world_camera: where that stands, axes right, down, forward, (4, 4).
        plane: (x, y, 1) of the plane, m, to its points in the world, m, (3, 3).
        homography: (x, y, 1) to the photograph's pixels (u, v, w); the middle of pixel (0, 0) is (0.5, 0.5), (3, 3).
        size: pixels along an edge of the photograph.

    Attributes:
        unseen: 255 where the camera's picture does not show the plane, uint8 (size, size).

    Raises:
        InvalidInputError: the camera sees nothing of it, or a homography that cannot be inverted.
    """

    def __init__(self, lens: Lens, pose_world_camera: np.ndarray, plane: np.ndarray, homography: np.ndarray, size: int):
        self.size = size
        back = np.linalg.inv(checked_homography(homography))
        camera = inverse(np.asarray(pose_world_camera, dtype=float))
        seen_from = camera[:3, :3] @ plane + np.outer(camera[:3, 3], [0.0, 0.0, 1.0])
        u, v = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
        places = np.stack([u.ravel(), v.ravel(), np.ones(size * size)])
        places = back @ places
        points = (seen_from @ (places / places[2])).T
        columns, rows = _pixels(lens, points).reshape(size, size, 2).transpose(2, 0, 1).astype(np.float32)
        inside = (columns >= 0) & (columns <= lens.width - 1) & (rows >= 0) & (rows <= lens.height - 1)
        if not inside.any():
            raise InvalidInputError("the camera's picture shows nothing of the plane; turn the camera to it")
        self.unseen = np.where(inside, 0, 255).astype(np.uint8)
        super().__init__(lens, cv2.convertMaps(columns, rows, cv2.CV_16SC2))
        self._place_of_silhouettes(np.asarray(pose_world_camera, dtype=float), points[inside.ravel()], plane, back)

    def _place_of_silhouettes(self, camera: np.ndarray, seen: np.ndarray, plane: np.ndarray, back: np.ndarray) -> None:
        """Prepare a straight picture from where the camera stands that holds all that the photograph shows."""
        forward = seen.mean(axis=0) / np.linalg.norm(seen.mean(axis=0))
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(forward, right), forward])  # in the camera's frame
        turned = seen @ axes.T
        widest = float(np.abs(turned[:, :2] / turned[:, 2:]).max())
        focal, middle = 0.49 * self.size / widest, self.size / 2.0
        matrix = np.array([[focal, 0.0, middle], [0.0, focal, middle], [0.0, 0.0, 1.0]])
        self._eye = camera[:3, 3]
        R = axes @ camera[:3, :3].T
        self._projection = matrix @ np.column_stack([R, -R @ self._eye])
        to_middles = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])  # OpenCV counts from middles
        onto = self._projection[:, :3] @ plane + np.outer(self._projection[:, 3], [0.0, 0.0, 1.0])
        self._from_photograph = np.linalg.inv(to_middles) @ onto @ back @ to_middles

    def hidden(self, solids: Solids) -> np.ndarray:
        """Return where the photograph does not show the plane: solids stand before it, or the picture ends.

        Args:
            solids: in the world.

        Returns:
            255 there, 0 elsewhere, uint8 (size, size).
        """
        standing = silhouette(solids, self._eye, self._projection, self.size)
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        carried = cv2.warpPerspective(standing, self._from_photograph, (self.size, self.size), flags=flags)
        return cv2.bitwise_or(carried, self.unseen)


def _pixels(lens: Lens, points: np.ndarray) -> np.ndarray:
    """Return where points of the camera's frame, (n, 3), m, are in its picture, (n, 2); far outside where nowhere."""
    corners = np.array([[[u, v]] for u in (0.0, lens.width - 1.0) for v in (0.0, lens.height - 1.0)])
    distortion = np.array(lens.distortion)
    widest = 1.1 * np.linalg.norm(cv2.undistortPoints(corners, lens.matrix, distortion), axis=-1).max()
    depth = np.maximum(points[:, 2:], _NEAR_M)
    straight = np.column_stack([points[:, :2] / depth, np.ones(len(points))])
    # Further out than the picture's corners the polynomials of the distortion mean nothing.
    outside = (points[:, 2] <= _NEAR_M) | (np.linalg.norm(straight[:, :2], axis=1) > widest)
    straight[outside] = [0.0, 0.0, 1.0]
    pixels = cv2.projectPoints(straight, np.zeros(3), np.zeros(3), lens.matrix, distortion)[0].reshape(-1, 2)
    pixels[outside] = _OUTSIDE
    return pixels
