"""Least squares find what was planted, believe the prior where nothing is shown, and know how sure they are."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe.logs.least_squares import Problem, solve

ROWS, JOINTS = 400, 2
TRUE = np.array([1.0, -2.0, 0.5])


def problem(noise=0.1, seed=0, correlated=1, spread=100.0, outliers=0):
    """Return two joints' torques from three unknowns, with noise that may stay for several rows."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(ROWS, JOINTS, 3))
    held = np.repeat(rng.normal(size=(ROWS // correlated + 1, JOINTS)), correlated, axis=0)[:ROWS]
    torque = columns @ TRUE + noise * held
    torque[:outliers] += 50.0
    return Problem(columns, torque, np.zeros(3), np.full(3, spread), np.ones((ROWS, JOINTS), dtype=bool))


def test_what_was_planted_is_found():
    found = solve(problem())
    assert_allclose(found.value, TRUE, atol=0.03)
    assert_allclose(found.residual.std(), 0.1, rtol=0.1)


def test_without_noise_it_is_exact():
    assert_allclose(solve(problem(noise=0.0)).value, TRUE, atol=1e-6)


def test_outliers_move_little():
    assert_allclose(solve(problem(outliers=15)).value, TRUE, atol=0.05)


def test_what_is_not_shown_stays_where_it_was_believed_to_be():
    one = problem()
    columns = one.columns.copy()
    columns[:, :, 1] = 0.0
    found = solve(one._replace(columns=columns, mean=np.array([0.0, 7.0, 0.0]), spread=np.array([100.0, 3.0, 100.0])))
    assert found.value[1] == pytest.approx(7.0)
    assert np.sqrt(found.covariance[1, 1]) == pytest.approx(3.0)


def test_torques_that_do_not_count_are_not_read():
    one = problem()
    torque, counts = one.torque.copy(), one.counts.copy()
    torque[::2], counts[::2] = 1e3, False
    assert_allclose(solve(one._replace(torque=torque, counts=counts)).value, TRUE, atol=0.05)


@pytest.mark.parametrize("correlated", [1, 10])
def test_confidence_covers_the_truth_also_where_noise_is_correlated(correlated):
    inside = 0
    for seed in range(40):
        one = problem(seed=seed, correlated=correlated)
        slow = np.repeat(one.columns[::correlated], correlated, axis=0)[:ROWS]
        found = solve(one._replace(columns=slow, torque=slow @ TRUE + one.torque - one.columns @ TRUE))
        inside += int((np.abs(found.value - TRUE) < 1.96 * np.sqrt(np.diag(found.covariance))).sum())
    assert inside >= 0.88 * 3 * 40


def test_a_part_has_its_rows():
    part = problem().part(slice(0, 100))
    assert part.torque.shape == (100, JOINTS)
    assert part.counts.shape == (100, JOINTS)
    assert len(part.mean) == 3
