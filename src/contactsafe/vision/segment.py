"""Ink in a photograph of the board: evened light, a threshold that follows the noise, specks that hold together.

What is too faint or too thin for that is still ink where it is a line: darker than both its sides, and long.
"""

from dataclasses import dataclass

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.vision.opencv import cv2
from contactsafe.vision.silhouette import fill, on_plane

INK_PIXEL, OTHER_PIXEL = 0, 255

_COARSE = 4  # photograph's pixels along an edge of one of the background's
_WINDOW = 5  # of the background's pixels: strokes and blobs must be narrower, shadows wider
_LINE_BLUR_PX = 1.2
_LINE_WIDTH_PX = 1.7  # of a thin line's core, in the mean
_GLARE = 17  # of the background's pixels: reflections are narrower
_DEEPEST = 0.20  # fraction of the board's brightness that is left in the darkest shadow


@dataclass(frozen=True)
class InkThresholds:
    """What counts as ink.

    Attributes:
        faint: a pixel this fraction darker than the board is ink if it hangs together with ink.
        clear: a pixel this fraction darker than the board is ink where its surroundings are sharp.
        sharp: change of brightness from one pixel to those around it, as a fraction of the board's.
        least_px: of the photograph's pixels, the fewest that make a speck.
        covered: fraction of a mask's pixel, covered by ink, that marks it.
        line: a pixel this fraction darker than both sides of a line may be ink, where the line is long.
        clear_line: a line has a pixel this much darker.
        line_px: of the photograph's pixels, how long a line is at least; half as many are as wide as one is at most.
        rim_px: margin inside the board's edge and around the arm's outline that is ignored, in the photograph's pixels;
            up to twice as far from them ink counts only if it goes on further inside.
    """

    faint: float = 0.15
    clear: float = 0.20
    sharp: float = 0.12
    least_px: int = 3
    covered: float = 0.10
    line: float = 0.03
    clear_line: float = 0.045
    line_px: int = 14
    rim_px: int = 3


class Segmenter:
    """Masks from the photographs of one camera that stands still, calibrated to the board.

    The board's own brightness is estimated by closing over more than a stroke's width; ink is what stays darker than
    that in some colour, by more than the picture's noise explains, and has a sharp edge, as no shadow has. No network,
    nothing learned.

    Args:
        homography: board plane (x, y, 1), m, to pixels of the photograph (u, v, w), (3, 3).
        corners: of the board, x and y in turn around it, (4, 2), m.
        photo_size: pixels along an edge of the photograph.
        mask_size: pixels along an edge of the mask.
        ink: thresholds of brightness and size.

    Raises:
        InvalidInputError: a size below 8 pixels, a homography that is not finite, a board that is not in view.
    """

    def __init__(
        self,
        homography: np.ndarray,
        corners: np.ndarray,
        photo_size: int = 455,
        mask_size: int = 128,
        ink: InkThresholds = InkThresholds(),
    ):
        homography, corners = np.asarray(homography, dtype=float), np.asarray(corners, dtype=float)
        if homography.shape != (3, 3) or not np.isfinite(homography).all() or corners.shape != (4, 2):
            raise InvalidInputError(
                f"homography has shape {homography.shape} and corners {corners.shape}; give finite (3, 3) and (4, 2)"
            )
        if min(photo_size, mask_size) < 8:
            raise InvalidInputError(f"photo_size = {photo_size}, mask_size = {mask_size}; give 8 or more pixels")
        self.photo_size, self.mask_size = photo_size, mask_size
        self.ink = ink
        self._rim = np.ones((2 * ink.rim_px + 1,) * 2, np.uint8)
        board = _board_seen(homography, corners, photo_size)
        self._board = cv2.erode(board, self._rim, borderType=cv2.BORDER_REPLICATE)
        left, top, width, height = cv2.boundingRect(self._board)
        if width == 0:
            raise InvalidInputError("the homography shows no board in the photograph; calibrate the camera anew")
        # Whole blocks of the background, which resizing takes faster.
        self._window = tuple(
            slice(start, start + max(length // _COARSE, 1) * _COARSE)
            for start, length in ((top, height), (left, width))
        )

    def segment(self, photo: np.ndarray, hidden: np.ndarray | None = None) -> np.ndarray:
        """Find the ink.

        Args:
            photo: uint8, (photo_size, photo_size, 3) or (photo_size, photo_size).
            hidden: not 0 where the arm stands before the board (`silhouette`), uint8, of the photograph's size.

        Returns:
            Mask, uint8 (mask_size, mask_size): 0 where ink is, everything else 255.

        Raises:
            InvalidInputError: a photograph of another shape or type.
        """
        n = self.photo_size
        photo = np.asarray(photo)
        if photo.dtype != np.uint8 or photo.shape not in ((n, n), (n, n, 3)):
            raise InvalidInputError(f"photo is {photo.dtype} of shape {photo.shape}; give uint8 ({n}, {n}, 3)")
        seen = self._board[self._window] if hidden is None else self._not_hidden(hidden)
        ink = np.zeros((n, n), np.uint8)
        if seen.any():
            darkest = _darkest(photo[self._window], seen)
            background = _background(darkest, seen)
            evened = cv2.divide(darkest, background, scale=_BRIGHT)
            # A camera some pixels off, or a picture that was straightened, has the dark edge of what is beyond here.
            well_inside = cv2.erode(seen, self._rim, borderType=cv2.BORDER_CONSTANT, borderValue=0)
            specks = self._ink(cv2.GaussianBlur(evened, (3, 3), 0), seen, well_inside)
            ink[self._window] = cv2.bitwise_or(specks, self._lines(darkest, background, well_inside))
        covered = cv2.resize(ink, (self.mask_size, self.mask_size), interpolation=cv2.INTER_AREA)
        return np.where(covered > 255 * self.ink.covered, INK_PIXEL, OTHER_PIXEL).astype(np.uint8)

    def beside(self, hidden: np.ndarray) -> np.ndarray:
        """Return which of the mask's pixels are beside the arm, bool (mask_size, mask_size); see `segment`.

        Within two rims of the arm only the end of a stroke can be seen, so all of that counts as hidden.
        """
        around_arm = cv2.dilate((hidden != 0).astype(np.uint8) * 255, self._rim, iterations=2)
        covered = cv2.resize(around_arm, (self.mask_size, self.mask_size), interpolation=cv2.INTER_AREA)
        return covered <= 255 * self.ink.covered

    def _not_hidden(self, hidden: np.ndarray) -> np.ndarray:
        """Return where the board is seen beside the arm, uint8."""
        n = self.photo_size
        if hidden.dtype != np.uint8 or hidden.shape != (n, n):
            raise InvalidInputError(f"hidden is {hidden.dtype} of shape {hidden.shape}; give uint8 ({n}, {n})")
        around_arm = cv2.dilate(hidden[self._window], self._rim)
        return cv2.bitwise_and(self._board[self._window], cv2.bitwise_not(around_arm))

    def _ink(self, evened: np.ndarray, seen: np.ndarray, well_inside: np.ndarray) -> np.ndarray:
        """255 where ink is: specks with a clear and sharp pixel well inside, with the faint ones around it, uint8."""
        middle, noise = _middle_and_spread(evened, seen)
        faint = middle - max(_BRIGHT * self.ink.faint, 4 * noise)
        clear = middle - max(_BRIGHT * self.ink.clear, 6 * noise)
        around = np.ones((3, 3), np.uint8)
        sharp = cv2.subtract(cv2.dilate(evened, around), cv2.erode(evened, around)) > _BRIGHT * self.ink.sharp
        candidates = cv2.bitwise_and((evened < faint).view(np.uint8), seen)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(candidates, connectivity=8)
        places = np.flatnonzero(candidates)
        names = labels.ravel()[places]
        kept = np.zeros(count, np.uint8)
        sure = (evened.ravel()[places] < clear) & sharp.ravel()[places] & (well_inside.ravel()[places] > 0)
        kept[names[sure]] = 255
        kept[stats[:, cv2.CC_STAT_AREA] < self.ink.least_px] = 0
        ink = np.zeros_like(evened)
        ink.ravel()[places] = kept[names]
        return ink

    def _lines(self, darkest: np.ndarray, background: np.ndarray, well_inside: np.ndarray) -> np.ndarray:
        """255 where a line is, uint8: long and narrow, and darker than both its sides, as no edge of light is."""
        smooth = cv2.min(darkest, background)  # what lies between two reflections is no line
        # What is beyond is black, so that the shadow beside it has no brighter side there.
        smooth = cv2.GaussianBlur(cv2.bitwise_and(smooth, well_inside), (5, 5), _LINE_BLUR_PX)
        sides = np.ones((self.ink.line_px * 2 // 3,) * 2, np.uint8)
        hollow = cv2.divide(cv2.morphologyEx(smooth, cv2.MORPH_BLACKHAT, sides), background, scale=_BRIGHT)
        usual, noise = _middle_and_spread(hollow, well_inside)
        core = hollow > cv2.dilate(hollow, np.ones((5, 5), np.uint8)) // 2  # and not what blurs beside it
        dark = hollow > max(usual + 5 * noise, _BRIGHT * self.ink.line)
        candidates = cv2.bitwise_and((dark & core).view(np.uint8), well_inside)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(candidates, connectivity=8)
        places = np.flatnonzero(candidates)
        names = labels.ravel()[places]
        kept = np.zeros(count, np.uint8)
        kept[names[hollow.ravel()[places] > max(usual + 7 * noise, _BRIGHT * self.ink.clear_line)]] = 255
        kept[stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1) < self.ink.line_px] = 0
        kept[stats[:, cv2.CC_STAT_AREA] < _LINE_WIDTH_PX * self.ink.line_px] = 0
        ink = np.zeros_like(darkest)
        ink.ravel()[places] = kept[names]
        return ink


def _board_seen(homography: np.ndarray, corners: np.ndarray, size: int) -> np.ndarray:
    """Draw 255 where the photograph shows the board, 0 elsewhere, uint8 (size, size)."""
    board = np.zeros((size, size), np.uint8)
    depths = corners @ homography[2, :2] + homography[2, 2]
    if (depths > 0).all() or (depths < 0).all():
        fill(board, np.clip(on_plane(corners, homography), -1e4, 1e4), 255)
    return board


_BRIGHT = 200.0  # what the board's own brightness is evened to: noise above it must not be cut off


def _darkest(photo: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """The darkest colour of each pixel, with the board taken for white, uint8."""
    if photo.ndim == 2:
        return photo
    channels = [np.ascontiguousarray(channel) for channel in cv2.split(photo)]
    whites = [max(1, _level(channel, seen, 0.9)) for channel in channels]
    levels = np.arange(256) / np.array(whites)[:, None]
    tables = np.clip(max(whites) * levels, 0, 255).astype(np.uint8)
    balanced = [cv2.LUT(channel, table) for channel, table in zip(channels, tables, strict=True)]
    return cv2.min(cv2.min(balanced[0], balanced[1]), balanced[2])


def _background(picture: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """What the picture would be without ink, uint8: dark things narrower than the window closed."""
    size = [max(1, edge // _COARSE) for edge in picture.shape[::-1]]
    coarse = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    whole = cv2.resize(seen, size, interpolation=cv2.INTER_AREA) == 255
    # Where something covers more than the window, the board's general brightness bounds the guess.
    coarse = np.maximum(coarse, int(_DEEPEST * _level(picture, seen, 0.9)))
    coarse[~whole] = 0
    window = np.ones((_WINDOW, _WINDOW), np.uint8)
    high = cv2.dilate(coarse, window)
    inside = high.copy()
    inside[~whole] = 255
    closed = cv2.min(cv2.erode(inside, window), high)
    smooth = np.maximum(cv2.GaussianBlur(_without_glare(closed, whole), (5, 5), 0), 1)
    return cv2.resize(smooth, picture.shape[::-1], interpolation=cv2.INTER_LINEAR)


def _without_glare(level: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Open the brightness of the board: a reflection is brighter than what is about it, and a gap in it no line."""
    window = np.ones((_GLARE, _GLARE), np.uint8)
    inside = np.where(whole, level, 255).astype(np.uint8)
    low = cv2.erode(inside, window)
    low[~whole] = 0
    return cv2.min(cv2.dilate(low, window), level)


def _histogram(picture: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Count the grey levels of what is seen, of every third pixel of every third row, (256,)."""
    sample, looked_at = (np.ascontiguousarray(plane[::3, ::3]) for plane in (picture, seen))
    return cv2.calcHist([sample], [0], looked_at, [256], [0, 256]).ravel()


def _level(picture: np.ndarray, seen: np.ndarray, fraction: float) -> int:
    """Grey level below which this fraction of what is seen lies."""
    counts = np.cumsum(_histogram(picture, seen))
    return int(np.searchsorted(counts, fraction * counts[-1]))


def _middle_and_spread(picture: np.ndarray, seen: np.ndarray) -> tuple[float, float]:
    """Median of what is seen, and the noise about it: 1.48 times the median distance, at least half a level."""
    counts = _histogram(picture, seen)
    total = counts.sum()
    middle = int(np.searchsorted(np.cumsum(counts), 0.5 * total))
    away = np.bincount(np.abs(np.arange(256) - middle), weights=counts)
    return float(middle), 1.48 * max(0.5, float(np.searchsorted(np.cumsum(away), 0.5 * total)))
