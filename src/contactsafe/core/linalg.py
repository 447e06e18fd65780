"""Small dense algebra for the compiled tick: at six or seven rows a LAPACK call costs more than the work."""

import math

import numpy as np

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.stack import stack_matrix


@compiled
def spd_inverse(A: Matrix, out: Matrix) -> bool:
    """Invert a symmetric positive-definite matrix by Cholesky, A = L Lᵀ.

    Args:
        A: (n, n).
        out: receives A⁻¹, (n, n); untouched on failure.

    Returns:
        False where A is not positive definite.
    """
    n = A.shape[0]
    L = stack_matrix(n, n)
    if not _cholesky(A, L):
        return False
    for j in range(n):  # L⁻¹ takes L's place column by column
        L[j, j] = 1.0 / L[j, j]
        for i in range(j + 1, n):
            s = 0.0
            for k in range(j, i):
                s -= L[i, k] * L[k, j]
            L[i, j] = s / L[i, i]
    for i in range(n):
        for j in range(i + 1):
            s = 0.0
            for k in range(i, n):
                s += L[k, i] * L[k, j]
            out[i, j] = s
            out[j, i] = s
    return True


@compiled
def _cholesky(A, L):
    """Fill the lower half of L with Cholesky's factor of A, both (n, n); False where there is none."""
    for j in range(A.shape[0]):
        d = A[j, j]
        for k in range(j):
            d -= L[j, k] * L[j, k]
        if not d > 0.0:
            return False
        L[j, j] = math.sqrt(d)
        for i in range(j + 1, A.shape[0]):
            s = A[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = s / L[j, j]
    return True


@compiled
def matmul(A: Matrix, B: Matrix) -> Matrix:
    """Multiply two small matrices, (m, k) and (k, n)."""
    return matmul_into(A, B, np.empty((A.shape[0], B.shape[1])))


@compiled
def matmul_into(A: Matrix, B: Matrix, out: Matrix) -> Matrix:
    """Write A B to `out`, which is neither of them, and give it back."""
    out[:] = 0.0
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            a = A[i, k]
            for j in range(B.shape[1]):
                out[i, j] += a * B[k, j]
    return out


@compiled
def matvec(A: Matrix, x: Vector) -> Vector:
    """Multiply a small matrix and a vector, (m, n) and (n,)."""
    return matvec_into(A, x, np.empty(A.shape[0]))


@compiled
def matvec_into(A: Matrix, x: Vector, out: Vector) -> Vector:
    """Write A x to `out`, which is not x, and give it back."""
    for i in range(A.shape[0]):
        s = 0.0
        for j in range(A.shape[1]):
            s += A[i, j] * x[j]
        out[i] = s
    return out


@compiled
def matvec_t(A: Matrix, x: Vector) -> Vector:
    """Multiply a transposed small matrix and a vector, Aᵀ x with (m, n) and (m,)."""
    return matvec_t_into(A, x, np.empty(A.shape[1]))


@compiled
def matvec_t_into(A: Matrix, x: Vector, out: Vector) -> Vector:
    """Write Aᵀ x to `out`, which is not x, and give it back."""
    out[:] = 0.0
    for i in range(A.shape[0]):
        a = x[i]
        for j in range(A.shape[1]):
            out[j] += A[i, j] * a
    return out


@compiled
def dot(x: Vector, y: Vector) -> float:
    """Multiply two small vectors, (n,) and (n,)."""
    s = 0.0
    for i in range(x.shape[0]):
        s += x[i] * y[i]
    return s


@compiled
def cross(x: Vector, y: Vector) -> Vector:
    """Give x × y, (3,)."""
    return cross_into(x, y, np.empty(3))


@compiled
def cross_into(x: Vector, y: Vector, out: Vector) -> Vector:
    """Write x × y, (3,), to `out`, which is neither of them, and give it back."""
    out[0] = x[1] * y[2] - x[2] * y[1]
    out[1] = x[2] * y[0] - x[0] * y[2]
    out[2] = x[0] * y[1] - x[1] * y[0]
    return out


@compiled
def shorten(x: Vector, length_max: float) -> None:
    """Scale a vector in place to a largest length."""
    length = math.sqrt(dot(x, x))
    if length > length_max:
        for i in range(x.shape[0]):
            x[i] *= length_max / length
