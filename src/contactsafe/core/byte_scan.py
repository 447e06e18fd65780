"""Pictures of which most is bare, gone through eight pixels at a time."""

import numpy as np

from contactsafe.core.compiled import compiled

WORD = 8
"""Pixels in a word."""


@compiled
def words_of(flat: np.ndarray) -> np.ndarray:
    """See a row of pixels, uint8 (n,), as words, uint64 (n // 8,); they need not begin at a multiple of eight bytes."""
    return flat[: flat.shape[0] // WORD * WORD].view(np.uint64)


@compiled
def places_unlike(flat: np.ndarray, bare: np.uint8, out: np.ndarray) -> int:
    """Find the pixels that are not bare.

    Args:
        flat: pixels in a row, uint8 (n,).
        bare: what most of them are, uint8.
        out: receives their numbers, in order, (n,).

    Returns:
        How many.
    """
    words = words_of(flat)
    bare_word = np.uint64(bare) * np.uint64(0x0101010101010101)
    count = 0
    for w in range(words.shape[0] + 1):
        if w < words.shape[0] and words[w] == bare_word:
            continue
        for p in range(WORD * w, min(WORD * (w + 1), flat.shape[0])):
            if flat[p] != bare:
                out[count] = p
                count += 1
    return count


@compiled
def copy_picture(source: np.ndarray, target: np.ndarray) -> None:
    """Copy a picture, uint8 of any shape, word by word: slices of two dimensions go pixel by pixel."""
    flat, out = source.reshape(-1), target.reshape(-1)
    words, out_words = words_of(flat), words_of(out)
    for w in range(words.shape[0]):
        out_words[w] = words[w]
    for p in range(WORD * words.shape[0], flat.shape[0]):
        out[p] = flat[p]
