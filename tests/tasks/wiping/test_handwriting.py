"""What a pen writes: a path without jumps, that runs to the right, and is the same again from the same seed."""

import numpy as np
import pytest

from contactsafe.tasks.wiping.handwriting import FONTS, WORDS, write_digits, write_words

pytest.importorskip("HersheyFonts")
pytest.importorskip("sklearn")
pytest.importorskip("scipy")


def words(text="hello", font=FONTS[0], seed=0):
    return write_words(text, font, np.random.default_rng(seed))


@pytest.mark.parametrize("font", FONTS)
@pytest.mark.parametrize("text", [WORDS[0], WORDS[-1], "f = m a"])
def test_words_are_about_a_capital_high_and_run_to_the_right(font, text):
    points = words(text, font)
    assert points.shape[1] == 2
    assert np.isfinite(points).all()
    assert 0.3 < np.ptp(points[:, 0]) < 3.0
    assert np.ptp(points[:, 1]) > np.ptp(points[:, 0])


@pytest.mark.parametrize("count", [1, 3, 5])
def test_a_number_is_a_digit_high_and_longer_with_each_digit(count):
    points = write_digits(count, np.random.default_rng(count))
    assert 0.5 < np.ptp(points[:, 0]) < 2.0
    assert np.ptp(points[:, 1]) < 2.0 * count


def test_more_text_is_a_longer_line():
    assert np.ptp(words("hello hello")[:, 1]) > 1.5 * np.ptp(words("hello")[:, 1])


def test_the_same_seed_writes_the_same_and_another_hand_does_not():
    np.testing.assert_array_equal(words(seed=1), words(seed=1))
    one, other = words(seed=1), words(seed=2)
    assert one.shape != other.shape or not np.allclose(one, other)
    digits = [write_digits(3, np.random.default_rng(seed)) for seed in (1, 1)]
    np.testing.assert_array_equal(*digits)
