"""What a pen has written: rows of people's digits, words in single-stroke fonts, as points along its path.

Digits are 1797 that thirteen people wrote, 8 × 8 grey pixels each (the test set of UCI's "Optical Recognition of
Handwritten Digits", Alpaydin & Kaynak 1998, as scikit-learn holds it); the path of the pen is found and painted anew.
Words are set in Hershey's fonts (1967), each letter a little off in size, place and slope, and wavering as a hand does.
"""

import functools
from typing import Any

import numpy as np

from contactsafe.core.errors import InvalidInputError

FONTS = ("cursive", "scripts", "futural")
"""Of Hershey's fonts, those of one stroke that a person might write on a board."""

WORDS = (
    "hello", "wipe me", "robot", "safe", "force", "torque", "touch", "gentle", "TODO", "ideas", "Monday", "lunch",
    "contact", "Panda", "f = m a", "energy", "careful", "thanks", "Q and A", "step 1", "next week", "why?", "ok!",
    "policy", "reward", "x + y = 7", "arm", "do not", "erase", "plan B", "60 Hz", "yes", "no", "maybe", "quick fox",
)  # fmt: skip

_CAPITAL = 21.0  # height of a capital in the units of Hershey's fonts
_TOP = 12.0  # of a capital above the middle, in the same units
_FINE = 8  # points along the edge of one of the digits' pixels
_STEP = 0.02  # of a capital's height: distance of points along a stroke


def write_digits(count: int, rng: np.random.Generator) -> np.ndarray:
    """Write a number, each digit by another hand.

    Args:
        count: of digits.
        rng: chooses digits, hands and places.

    Returns:
        Points along the pen's path, (k, 2): down and to the right, in heights of a digit; the line runs to the right.

    Raises:
        InvalidInputError: scikit-learn is not installed.
    """
    points, pen = [], 0.0
    for _ in range(count):
        digit = _middle_line(int(rng.integers(len(_digit_images())))) * rng.uniform(0.9, 1.1)
        points.append(digit + np.array([rng.normal(0.0, 0.04), pen]))
        pen += np.ptp(digit[:, 1]) + rng.uniform(0.18, 0.4)
    return np.concatenate(points)


def write_words(text: str, font: str, rng: np.random.Generator) -> np.ndarray:
    """Write words.

    Args:
        text: ASCII.
        font: one of FONTS.
        rng: moves, scales and turns each letter.

    Returns:
        Points along the pen's path, (k, 2): down and to the right, in heights of a capital; the line runs to the right.

    Raises:
        InvalidInputError: Hershey-Fonts is not installed.
    """
    points, pen = [], 0.0
    for glyph in _font(font).glyphs_for_text(text):
        size = rng.uniform(0.92, 1.08) / _CAPITAL
        turn = rng.normal(0.0, 0.03)
        for stroke in glyph.strokes:
            x, y = np.array([(x - glyph.left_offset, y + _TOP) for x, y in stroke], dtype=float).T * size
            points.append(_along(np.column_stack([y + turn * x, pen + x - turn * y])))
        pen += glyph.char_width * size
    written = np.concatenate(points)
    return written + _wavering(written, rng)


def _along(corners: np.ndarray) -> np.ndarray:
    """Return points close to each other along a polyline, (k, 2)."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.linspace(0.0, lengths[-1], 2 + int(lengths[-1] / _STEP))
    return np.column_stack([np.interp(at, lengths, corners[:, k]) for k in (0, 1)])


def _wavering(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Displace points smoothly, by some hundredths of a capital's height; neighbours go together, (k, 2)."""
    moved = np.zeros_like(points)
    for waves in (1.5, 4.0):
        direction = rng.normal(0.0, waves, (2, 2))
        phase = rng.uniform(0.0, 2 * np.pi, 2)
        moved += 0.06 / waves * np.sin(points @ direction + phase)
    return moved


@functools.cache
def _middle_line(index: int) -> np.ndarray:
    """Find the path of the pen that left a grey 8 × 8 digit, (k, 2), from its top and left, in its heights."""
    images = _digit_images()
    from scipy import ndimage

    fine = ndimage.zoom(np.pad(images[index], 2), _FINE, order=3, mode="grid-constant", grid_mode=True)
    ridge = fine - ndimage.gaussian_filter(fine, _FINE) > 0.08  # what stands out from a pixel's surroundings
    points = np.argwhere(_thinned(ridge & (fine > 0.25))).astype(float)
    points -= points.min(axis=0)
    return points / max(points[:, 0].max(), 1.0)


def _thinned(image: np.ndarray) -> np.ndarray:
    """Reduce shapes to their middle lines, one pixel wide (Zhang & Suen 1984, Communications of the ACM 27(3))."""
    left = np.pad(image, 1)
    ring = ((1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1))  # above, then clockwise
    while True:
        before = left.copy()
        for corner in ("south-east", "north-west"):
            around = [np.roll(left, shift, (0, 1)) for shift in ring]
            count = np.sum(around, axis=0)
            rises = np.sum([~a & b for a, b in zip(around, [*around[1:], around[0]], strict=True)], axis=0)
            north, east, south, west = around[::2]
            if corner == "south-east":
                keep = (north & east & south) | (east & south & west)
            else:
                keep = (north & east & west) | (north & south & west)
            left &= ~((count >= 2) & (count <= 6) & (rises == 1) & ~keep)
        if (left == before).all():
            return left[1:-1, 1:-1]


@functools.cache
def _digit_images() -> np.ndarray:
    """Read the digits, (1797, 8, 8), 0 to 1."""
    try:
        from sklearn.datasets import load_digits
    except ImportError as error:
        raise _missing("digits", "scikit-learn") from error
    return load_digits().images / 16.0


@functools.cache
def _font(name: str) -> Any:
    try:
        from HersheyFonts import HersheyFonts
    except ImportError as error:
        raise _missing("text", "Hershey-Fonts") from error
    return HersheyFonts(load_default_font=name)


def _missing(what: str, package: str) -> InvalidInputError:
    return InvalidInputError(f"boards with {what} need {package}; run: pip install 'contactsafe[handwriting]'")
