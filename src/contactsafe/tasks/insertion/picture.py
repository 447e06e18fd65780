"""The insertion task from above: the block's face, its hole, where that is believed to be, and the peg."""

from typing import NamedTuple

import numpy as np

SIZE = 512
"""Pixels along an edge."""

HALF_M = 0.03
"""Half edge of the square about the believed mouth that is shown, m."""

FACE, HOLE, PEG, BELIEVED = (226, 222, 214), (70, 70, 76), (230, 120, 30), (30, 90, 200)
"""Colours of the block's face, the hole, the peg and the cross on the believed mouth."""

_RING_M = 0.0008  # width of the peg's outline
_CROSS_M, _LINE_M = 0.004, 0.0003  # half length and half width of the cross's lines
_BAR = 16  # pixels: width of the bar at the edge, which shows how deep the peg is


class TopView(NamedTuple):
    """What is seen; places along x and y, (2,), m.

    Attributes:
        believed, mouth, tip: where the mouth is believed to be, where it is, and the peg's tip.
        hole_radius, peg_radius: m.
        inserted: how deep the peg is, as a fraction of what counts as inserted.
    """

    believed: np.ndarray
    mouth: np.ndarray
    tip: np.ndarray
    hole_radius: float
    peg_radius: float
    inserted: float


def paint(view: TopView) -> np.ndarray:
    """Return the picture, uint8 (SIZE, SIZE, 3): x points up and y to the left, as behind the arm."""
    steps = HALF_M * (1.0 - (2.0 * np.arange(SIZE) + 1.0) / SIZE)
    x, y = steps[:, None] + view.believed[0], steps[None, :] + view.believed[1]
    picture = np.full((SIZE, SIZE, 3), FACE, np.uint8)
    picture[np.hypot(x - view.mouth[0], y - view.mouth[1]) < view.hole_radius] = HOLE
    from_tip = np.hypot(x - view.tip[0], y - view.tip[1])
    picture[(from_tip < view.peg_radius) & (from_tip > view.peg_radius - _RING_M)] = PEG
    across, along = np.abs(x - view.believed[0]), np.abs(y - view.believed[1])
    picture[(np.minimum(across, along) < _LINE_M) & (np.maximum(across, along) < _CROSS_M)] = BELIEVED
    rows = round(SIZE * min(max(view.inserted, 0.0), 1.0))
    picture[SIZE - rows :, SIZE - _BAR :] = PEG
    return picture
