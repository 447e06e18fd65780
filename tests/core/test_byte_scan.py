"""Pictures gone through by words are gone through to the last pixel, wherever in memory they begin."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from contactsafe.core.byte_scan import copy_picture, places_unlike


@pytest.mark.parametrize("size", [1, 7, 8, 81, 4096])
@pytest.mark.parametrize("bare", [0, 255])
@pytest.mark.parametrize("offset", [0, 3])
def test_what_is_not_bare_is_found_in_order(size, bare, offset):
    rng = np.random.default_rng(size)
    flat = np.full(size + offset, bare, np.uint8)[offset:]
    flat[rng.random(size) < 0.1] = 7
    flat[-1] = 7
    out = np.empty(size, np.int32)
    assert_array_equal(out[: places_unlike(flat, np.uint8(bare), out)], np.flatnonzero(flat != bare))


@pytest.mark.parametrize("shape", [(1, 1), (9, 9), (128, 128)])
def test_a_picture_is_copied_whole(shape):
    source = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
    target = np.zeros(shape, np.uint8)
    copy_picture(source, target)
    assert_array_equal(source, target)
