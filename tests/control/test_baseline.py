"""What the residual shows about a posture while nothing touches is no change of it."""

import numpy as np
import pytest

from contactsafe.control.baseline import baseline_dtype, follow_baseline
from contactsafe.core.compiled import compiled


@compiled
def _follow(baselines, residual, q, untouched, dt):
    follow_baseline(baselines[0], residual, q, untouched, dt)


def followed(residual, q=(0.0, 0.0), seconds=2.0, baselines=None, untouched=True, dt=0.001):
    baselines = np.zeros(1, baseline_dtype(2)) if baselines is None else baselines
    for _ in range(round(seconds / dt)):
        _follow(baselines, np.asarray(residual, float), np.asarray(q, float), untouched, dt)
    return baselines


def test_nothing_is_known_at_first():
    assert followed((1.0, 2.0), seconds=0.01)["weight"][0] < 0.1


@pytest.mark.parametrize("dt", [0.0005, 0.001, 0.011])
def test_what_stays_is_learned_at_any_rate(dt):
    baselines = followed((1.0, -2.0), dt=dt)
    np.testing.assert_allclose(baselines["residual"][0], (1.0, -2.0), rtol=0.02)
    assert baselines["weight"][0] == pytest.approx(1.0)


def test_a_touch_is_not_learned_however_long():
    baselines = followed((1.0, 0.0))
    followed((9.0, 0.0), seconds=20.0, baselines=baselines, untouched=False)
    np.testing.assert_allclose(baselines["residual"][0], (1.0, 0.0), atol=1e-6)


def test_elsewhere_it_says_nothing_and_back_again_it_does():
    baselines = followed((1.0, 0.0))
    followed((1.0, 0.0), (0.1, 0.0), 0.001, baselines, untouched=False)
    assert 0.4 < baselines["weight"][0] < 0.6
    followed((1.0, 0.0), (0.5, 0.0), 0.001, baselines, untouched=False)
    assert baselines["weight"][0] == 0.0
    followed((1.0, 0.0), (0.0, 0.0), 0.001, baselines, untouched=False)
    assert baselines["weight"][0] == pytest.approx(1.0)
