"""A real camera's lens: from its picture to the undistorted square about the board, and back for a synthetic one."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.opencv import cv2

_GREY = 90  # of what stands about the board


@dataclass(frozen=True)
class Lens:
    """A pinhole with distortion, as OpenCV and librealsense have it (Brown, Conrady).

    Attributes:
        width, height: of the picture, pixels.
        fx, fy, cx, cy: focal lengths and principal point, pixels; the middle of pixel (0, 0) is (0, 0).
        distortion: k1, k2, p1, p2, k3.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Refuse what is no lens."""
        numbers = (self.fx, self.fy, self.cx, self.cy, *self.distortion)
        if min(self.width, self.height) < 16 or min(self.fx, self.fy) <= 0.0 or not np.isfinite(numbers).all():
            raise InvalidInputError(
                f"lens {self.width} × {self.height}, fx = {self.fx}, fy = {self.fy}; give 16 pixels or more, focal "
                "lengths above 0, finite numbers"
            )

    @classmethod
    def of_realsense(cls, known: Any) -> "Lens":
        """Return librealsense's `intrinsics` as a lens."""
        k1, k2, p1, p2, k3 = known.coeffs
        return cls(known.width, known.height, known.fx, known.fy, known.ppx, known.ppy, (k1, k2, p1, p2, k3))

    @property
    def matrix(self) -> np.ndarray:
        """OpenCV's camera matrix, (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


class View(Independent):
    """A square photograph that is looked up in a camera's picture.

    Args:
        lens: of the camera.
        maps: for each pixel of the photograph where it is in the picture, as `cv2.convertMaps` returns it.
    """

    def __init__(self, lens: Lens, maps: tuple[np.ndarray, np.ndarray]):
        self.lens, self._maps = lens, maps

    def cut(self, picture: np.ndarray) -> np.ndarray:
        """Return the photograph, uint8 (size, size, 3), of a camera's picture, uint8 (height, width, 3).

        Raises:
            InvalidInputError: the picture has another shape or type.
        """
        picture = np.asarray(picture)
        if picture.shape != (self.lens.height, self.lens.width, 3) or picture.dtype != np.uint8:
            raise InvalidInputError(
                f"picture is {picture.dtype} of shape {picture.shape}; give uint8 "
                f"({self.lens.height}, {self.lens.width}, 3)"
            )
        return cv2.remap(picture, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)


class Square(View):
    """The undistorted square of a camera's picture that a photograph is.

    Args:
        lens: of the camera.
        size: pixels along an edge of the photograph.
        focal_px: its focal length, pixels.

    Attributes:
        matrix: OpenCV's camera matrix of the photograph, (3, 3).
    """

    def __init__(self, lens: Lens, size: int, focal_px: float):
        self.size = size
        middle = (size - 1) / 2.0
        self.matrix = np.array([[focal_px, 0.0, middle], [0.0, focal_px, middle], [0.0, 0.0, 1.0]])
        distortion, straight = np.array(lens.distortion), np.eye(3)
        maps = cv2.initUndistortRectifyMap(lens.matrix, distortion, straight, self.matrix, (size, size), cv2.CV_16SC2)
        super().__init__(lens, maps)


class Distorted(Independent):
    """What a camera with a lens makes of a photograph: the synthetic counterpart of `Square`.

    Args:
        square: that the photograph is.
        turned: the camera's axes in those of the photograph's, (3, 3); None where they are the same.
    """

    def __init__(self, square: Square, turned: np.ndarray | None = None):
        lens, size, turned = square.lens, square.size, np.eye(3) if turned is None else turned
        columns, rows = np.meshgrid(np.arange(lens.width, dtype=np.float32), np.arange(lens.height, dtype=np.float32))
        seen = np.stack([columns.ravel(), rows.ravel()], axis=1)[:, None]
        straight = cv2.undistortPoints(seen, lens.matrix, np.array(lens.distortion), R=turned, P=square.matrix)[:, 0]
        u, v = (straight[:, k].reshape(lens.height, lens.width).astype(np.float32) for k in (0, 1))
        reached = (u > -1.0) & (u < size) & (v > -1.0) & (v < size)
        places = np.nonzero(reached)
        self._window = tuple(slice(int(place.min()), int(place.max()) + 1) for place in places)
        self._maps = cv2.convertMaps(u[self._window], v[self._window], cv2.CV_16SC2)
        self._grey = np.full((lens.height, lens.width, 3), _GREY, np.uint8)

    def picture(self, photograph: np.ndarray) -> np.ndarray:
        """Return the camera's picture, uint8 (height, width, 3); grey where the photograph does not reach."""
        picture = self._grey.copy()
        picture[self._window] = cv2.remap(
            photograph, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(_GREY,) * 3
        )
        return picture
