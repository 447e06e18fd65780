"""Small algebra against NumPy's."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.core.linalg import cross, cross_into, dot, matmul, matvec, matvec_t, spd_inverse


@pytest.fixture
def rng():
    return np.random.default_rng(4)


@pytest.mark.parametrize("n", range(1, 10))
def test_spd_inverse(rng, n):
    B = rng.normal(size=(n, n))
    A, out = B @ B.T + 0.1 * np.eye(n), np.zeros((n, n))
    assert spd_inverse(A, out)
    assert_allclose(out, np.linalg.inv(A), rtol=1e-9, atol=1e-9)
    assert_array_equal(out, out.T)


@pytest.mark.parametrize("diagonal", [[1.0, 0.0], [1.0, -1.0], [np.nan, 1.0]])
def test_spd_inverse_refuses_what_is_not_positive_definite(diagonal):
    out = np.full((2, 2), 5.0)
    assert not spd_inverse(np.diag(diagonal), out)
    assert_array_equal(out, 5.0)


@pytest.mark.parametrize(("m", "k", "n"), [(6, 7, 7), (7, 6, 6), (1, 7, 3), (3, 1, 2)])
def test_products(rng, m, k, n):
    A, B, x, y = rng.normal(size=(m, k)), rng.normal(size=(k, n)), rng.normal(size=k), rng.normal(size=m)
    assert_allclose(matmul(A, B), A @ B, rtol=0, atol=1e-14)
    assert_allclose(matvec(A, x), A @ x, rtol=0, atol=1e-14)
    assert_allclose(matvec_t(A, y), A.T @ y, rtol=0, atol=1e-14)
    assert_allclose(dot(x, x), x @ x, rtol=0, atol=1e-14)


def test_cross(rng):
    x, y, out = rng.normal(size=3), rng.normal(size=3), np.zeros(3)
    cross_into(x, y, out)
    assert_array_equal(out, np.cross(x, y))
    assert_array_equal(out, cross(x, y))
