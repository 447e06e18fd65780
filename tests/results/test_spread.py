"""A spread over seeds: ordered statistics of what exists, whatever the order of the trials."""

import math

import numpy as np
import pytest

from contactsafe.results.spread import spread


@pytest.mark.parametrize("values", [[], [math.nan], [math.inf, -math.inf, math.nan]])
def test_of_nothing_every_statistic_is_nan_and_the_count_is_0(values):
    found = spread(values)
    assert found.n == 0
    assert all(math.isnan(value) for name, value in found.as_dict().items() if name != "n")


@pytest.mark.parametrize("seed", range(5))
def test_statistics_are_ordered_and_do_not_depend_on_the_order_of_trials(seed):
    rng = np.random.default_rng(seed)
    values = [*rng.normal(size=rng.integers(1, 40)).tolist(), math.nan]
    found = spread(values)
    assert found.min <= found.p5 <= found.median <= found.p95 <= found.max
    assert found.min <= found.mean <= found.max
    assert found.n == len(values) - 1
    shuffled = spread(rng.permutation(values).tolist())
    assert shuffled.as_dict() == pytest.approx(found.as_dict(), rel=1e-12)


def test_its_middle_is_the_median_until_the_mean_is_asked_for():
    found = spread([0.0, 0.0, 3.0])
    assert (found.middle, found.centred_on_mean().middle) == (0.0, 1.0)
    assert found.centred_on_mean().as_dict() == found.as_dict()
