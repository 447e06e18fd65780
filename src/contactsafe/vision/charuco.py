"""The calibration target: a ChArUco pattern, a chessboard whose white squares hold markers, as data and in pictures.

Its frame lies in its middle: x to the right and y up as one reads it, z out of the paper. Every corner of the
chessboard is known by number, so a picture that shows a part of it is of use (Garrido-Jurado et al. 2014; OpenCV).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.opencv import cv2

_MARKER = 0.75
"""Edge of a marker, as a fraction of its square's."""

_MARKERS = 50  # of the dictionary, of 4 × 4 bits

_FINER = 2
"""By which pictures are enlarged: more markers are read that are seen small and aslant."""


class Corners(NamedTuple):
    """What of a target a picture shows.

    Attributes:
        ids: numbers of the inner corners, (n,).
        pixels: where they are, (n, 2), columns and rows; the middle of pixel (0, 0) is (0, 0), as `Lens` has it.
    """

    ids: np.ndarray
    pixels: np.ndarray


@dataclass(frozen=True)
class CharucoTarget:
    """A printed target.

    Attributes:
        columns, rows: squares along x and y.
        square_m: edge of a square as printed, m.

    Raises:
        InvalidInputError: squares that are too few or too many for the markers there are, or no size.
    """

    columns: int = 7
    rows: int = 5
    square_m: float = 0.036

    def __post_init__(self) -> None:
        """Refuse what is no target."""
        if min(self.columns, self.rows) < 3 or self.columns * self.rows // 2 > _MARKERS:
            raise InvalidInputError(
                f"target of {self.columns} × {self.rows} squares; give 3 or more each, {2 * _MARKERS} at most in all"
            )
        if not 0.005 <= self.square_m <= 0.5:
            raise InvalidInputError(f"target with squares of {1000 * self.square_m:g} mm; give 5 to 500 mm")

    @property
    def extent(self) -> tuple[float, float]:
        """Of the pattern along x and y, m."""
        return self.columns * self.square_m, self.rows * self.square_m

    @property
    def named(self) -> dict[str, np.ndarray]:
        """Outer corners by the letter that is printed beside them, (3,) each, m."""
        x, y = (edge / 2.0 for edge in self.extent)
        places = {"A": (-x, -y), "B": (x, -y), "C": (-x, y), "D": (x, y)}
        return {letter: np.array([*place, 0.0]) for letter, place in places.items()}

    def points(self, ids: np.ndarray) -> np.ndarray:
        """Return the places of inner corners by their numbers, (n,): (n, 3), m."""
        return self._from_opencv(np.asarray(self._pattern().getChessboardCorners(), dtype=float)[np.ravel(ids)])

    def rectangles(self) -> np.ndarray:
        """Return all that is black: lower left corner and size of rectangles, (k, 4), m."""
        squares = [
            (i * self.square_m, j * self.square_m, self.square_m)
            for j in range(self.rows)
            for i in range(self.columns)
            if (i + j) % 2 == 0
        ]
        pattern, dictionary = self._pattern(), _dictionary()
        bits = dictionary.markerSize + 2
        edge = _MARKER * self.square_m / bits
        for number, corners in zip(pattern.getIds(), pattern.getObjPoints(), strict=True):
            dark = cv2.aruco.generateImageMarker(dictionary, int(number), bits) == 0
            x, y = np.asarray(corners, dtype=float)[0, :2]
            squares += [(x + column * edge, y + row * edge, edge) for row, column in np.argwhere(dark)]
        left, top, edges = np.array(squares).T
        lower = self._from_opencv(np.stack([left, top + edges], axis=1))[:, :2]
        return np.column_stack([lower, edges, edges])

    def find(self, picture: np.ndarray) -> Corners:
        """Find the corners that a picture shows, uint8 (height, width) or (height, width, 3); none where none."""
        grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        twice = cv2.resize(grey, None, fx=_FINER, fy=_FINER, interpolation=cv2.INTER_CUBIC)
        found, ids, _, _ = cv2.aruco.CharucoDetector(self._pattern()).detectBoard(twice)
        if ids is None or len(ids) == 0:
            return Corners(np.zeros(0, dtype=int), np.zeros((0, 2)))
        pixels = (np.asarray(found, dtype=float).reshape(-1, 2) + 0.5) / _FINER - 0.5
        return Corners(np.ravel(ids).astype(int), pixels)

    def _pattern(self) -> "cv2.aruco.CharucoBoard":
        size = (self.columns, self.rows)
        return cv2.aruco.CharucoBoard(size, self.square_m, _MARKER * self.square_m, _dictionary())

    def _from_opencv(self, places: np.ndarray) -> np.ndarray:
        """Turn OpenCV's places, from the upper left corner downwards, (n, 2) or wider, into the target's, (n, 3)."""
        width, height = self.extent
        return np.column_stack([places[:, 0] - width / 2.0, height / 2.0 - places[:, 1], np.zeros(len(places))])


def _dictionary() -> "cv2.aruco.Dictionary":
    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
