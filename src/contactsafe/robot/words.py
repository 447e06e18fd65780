"""Pictures of which most is bare, looked at eight pixels at a time."""

import numpy as np

from contactsafe.compiled import compiled

WORD = 8
"""Pixels in a word."""

BARE = np.uint64(2**64 - 1)
"""Eight pixels of a mask without ink: all 255."""


@compiled
def words_of(flat):
    """See a row of pixels, uint8 (n,), as words, uint64 (n // 8,)."""
    return flat[: flat.shape[0] // WORD * WORD].view(np.uint64)
