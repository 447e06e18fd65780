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


@compiled
def copy_picture(source, target):
    """Copy a picture, uint8 of any shape, word by word: slices of two dimensions go pixel by pixel."""
    flat, out = source.reshape(-1), target.reshape(-1)
    words, out_words = words_of(flat), words_of(out)
    for w in range(words.shape[0]):
        out_words[w] = words[w]
    for p in range(WORD * words.shape[0], flat.shape[0]):
        out[p] = flat[p]
