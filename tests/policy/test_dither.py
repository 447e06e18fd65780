"""Dither moves x_d along x and y by little, never rests, and is the same again for the same step."""

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.dither import Dither

STEPS = np.arange(1200)


def motion(dither):
    return dither.over(np.zeros((len(STEPS), 18)), STEPS)


def test_only_x_and_y_move_and_by_no_more_than_the_amplitude():
    moved = motion(Dither(0.3))
    assert np.abs(moved[:, :2]).max() <= 0.3 + 1e-6
    assert not moved[:, 2:].any()
    assert moved.dtype == np.float32


def test_it_never_rests_and_has_no_mean():
    moved = motion(Dither(0.3, period_s=2.0, rate_hz=60.0))[:, :2]
    assert np.linalg.norm(moved, axis=1).max() > 0.3
    assert np.linalg.norm(np.diff(moved, axis=0), axis=1).min() > 0.0
    assert np.abs(moved.mean(axis=0)).max() < 0.02


def test_x_has_the_stated_period_and_y_does_not_repeat_with_it():
    moved = motion(Dither(0.3, period_s=2.0, rate_hz=60.0))
    np.testing.assert_allclose(moved[120:, 0], moved[:-120, 0], atol=1e-4)
    assert np.abs(moved[120:, 1] - moved[:-120, 1]).max() > 0.1


def test_it_depends_on_the_step_alone():
    dither, rng = Dither(), np.random.default_rng(0)
    actions, steps = rng.uniform(-1, 1, (7, 18)), rng.integers(0, 1000, 7)
    together = dither.over(actions, steps)
    apart = np.concatenate([dither.over(actions[k : k + 1], steps[k : k + 1]) for k in range(7)])
    np.testing.assert_array_equal(together, apart)


def test_actions_stay_allowed_and_the_callers_own_are_not_touched():
    actions = np.ones((3, 18), np.float32)
    moved = Dither(1.0).over(actions, np.array([0, 30, 60]))
    assert np.abs(moved).max() <= 1.0
    assert (actions == 1.0).all()


def test_without_amplitude_nothing_moves():
    actions = np.random.default_rng(1).uniform(-1, 1, (4, 18)).astype(np.float32)
    np.testing.assert_array_equal(Dither(0.0).over(actions, np.arange(4)), actions)


@pytest.mark.parametrize(
    "fields",
    [{"amplitude": -0.1}, {"amplitude": 1.1}, {"amplitude": float("nan")}, {"period_s": 0.0}, {"rate_hz": 1e9}],
)
def test_a_motion_that_is_none_is_refused(fields):
    with pytest.raises(InvalidInputError, match="give 0 ≤ amplitude ≤ 1, "):
        Dither(**fields)
