"""One piece of ink at a time: what a policy that stands still between two of them is shown."""

import numpy as np

from contactsafe.vision.opencv import cv2
from contactsafe.vision.segment import INK_PIXEL, OTHER_PIXEL

LEAST_PX = 5
"""Fewer inked pixels than this may be specks: a dot smaller than one pixel can touch four."""

_APART_PX = 5
"""Ink of the mask no further apart than this, 23 mm across the board, is one piece: the strokes of a letter are."""


class Goal:
    """The ink that is shown: all of it, or one piece from when nothing gets done until that piece is gone."""

    def __init__(self) -> None:
        self._piece: np.ndarray | None = None

    def drop(self) -> None:
        """Show all ink again."""
        self._piece = None

    def show(self, mask: np.ndarray, left: np.ndarray, pixel: np.ndarray, is_undecided: bool) -> np.ndarray:
        """Return the mask, or what it shows of one piece.

        Args:
            mask: as segmented, uint8 (n, n).
            left: where ink is, seen or last seen behind the arm, bool (n, n).
            pixel: column and row of the tool in it, whence the nearest piece is chosen.
            is_undecided: nothing has got done for a while.
        """
        if self._piece is not None and not (left & self._piece).any():
            self._piece = None
        if self._piece is None and is_undecided:
            self._piece = _nearest_piece(mask == INK_PIXEL, pixel)
        if self._piece is None:
            return mask
        return np.where(self._piece, mask, OTHER_PIXEL).astype(np.uint8)


def _nearest_piece(ink: np.ndarray, pixel: np.ndarray) -> np.ndarray | None:
    """Return where the piece nearest to a pixel is, bool, (n, n); a speck only where all are, None without ink."""
    around = cv2.dilate(ink.astype(np.uint8), np.ones((_APART_PX,) * 2, np.uint8))
    _, pieces = cv2.connectedComponents(around)
    areas = np.bincount(pieces[ink])
    large = ink & (areas[np.where(ink, pieces, 0)] >= LEAST_PX) if ink.any() else ink
    places = np.argwhere(large if large.any() else ink)
    if len(places) == 0:
        return None
    nearest = places[np.linalg.norm(places + 0.5 - pixel[::-1], axis=1).argmin()]
    return pieces == pieces[tuple(nearest)]
