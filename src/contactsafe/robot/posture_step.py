"""One step of Newton's method for `robot.posture`: onto the pose, and along it to where the cost is least."""

import math

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot, spd_inverse
from contactsafe.core.stack import stack_matrix, stack_vector

_LOST = 1e-3
"""A task direction of less is as good as lost, m or rad per unit of the cost's root."""


@compiled
def newton_step(J: Matrix, error: Vector, slope: Vector, scale: Vector, step: Vector) -> None:
    """Fill the step of Newton's method on W − μ · pose, (n,).

    In joints scaled so that W'' = 1, rows of Y from Gram and Schmidt: the first span what moves the tool, the others
    are the null space Z. Along the first the step takes the error off; along the others it goes down W − μ · pose,
    whose second derivative is 1 − C, C being the curvature of the pose times μ.
    """
    n = slope.shape[0]
    Y, L, C, made_by = stack_matrix(n, n), stack_matrix(6, n), stack_matrix(n, n), stack_vector(n)
    descent, mu, along = stack_vector(n), stack_vector(6), stack_vector(n)
    rank = _task_rows(J, scale, Y, L, made_by)
    _complete(Y, rank)
    for k in range(n):
        descent[k] = 0.0
        for i in range(n):
            descent[k] -= Y[k, i] * slope[i] * scale[i]
    step[:] = 0.0
    for k in range(rank):  # L along = error
        a = int(made_by[k])
        along[k] = error[a]
        for j in range(k):
            along[k] -= L[a, j] * along[j]
        along[k] /= L[a, k]
        for i in range(n):
            step[i] += along[k] * Y[k, i]
    if rank < n:
        _multipliers(L, made_by, descent, rank, mu)
        _curvature(J, mu, scale, C)
        _descend(Y, C, descent, rank, step)
    for i in range(n):
        step[i] *= scale[i]


@compiled
def _task_rows(J: Matrix, scale: Vector, Y: Matrix, L: Matrix, made_by: Vector) -> int:
    """Fill orthonormal rows Y (n, n) and L (6, n) with J diag(scale) = L Y, and which row of J made each of Y.

    Returns:
        How many; a row of J that adds next to nothing to those before it makes none.
    """
    n, rank = scale.shape[0], 0
    for a in range(6):
        if rank == n:
            break
        row = Y[rank]
        for i in range(n):
            row[i] = J[a, i] * scale[i]
        for k in range(rank):
            L[a, k] = dot(row, Y[k])
            for i in range(n):
                row[i] -= L[a, k] * Y[k, i]
        length = math.sqrt(dot(row, row))
        if length > _LOST:
            for i in range(n):
                row[i] /= length
            L[a, rank], made_by[rank] = length, a
            rank += 1
    return rank


@compiled
def _complete(Y: Matrix, rank: int) -> None:
    """Fill the rows of Y, (n, n), from rank on so that all are orthonormal."""
    n = Y.shape[0]
    for row in range(rank, n):
        best, pivot = -1.0, 0
        for i in range(n):
            left = 1.0
            for k in range(row):
                left -= Y[k, i] * Y[k, i]
            if left > best:
                best, pivot = left, i
        for i in range(n):
            Y[row, i] = 1.0 if i == pivot else 0.0
        for k in range(row):
            part = Y[k, pivot]
            for i in range(n):
                Y[row, i] -= part * Y[k, i]
        length = math.sqrt(dot(Y[row], Y[row]))
        for i in range(n):
            Y[row, i] /= length


@compiled
def _multipliers(L: Matrix, made_by: Vector, descent: Vector, rank: int, mu: Vector) -> None:
    """Fill what each task direction costs, μ with Lᵀ μ = −descent, (6,); 0 for those that made no row."""
    mu[:] = 0.0
    for k in range(rank - 1, -1, -1):
        cost = -descent[k]
        for j in range(k + 1, rank):
            cost -= L[int(made_by[j]), k] * mu[int(made_by[j])]
        mu[int(made_by[k])] = cost / L[int(made_by[k]), k]


@compiled
def _curvature(J: Matrix, mu: Vector, scale: Vector, C: Matrix) -> None:
    """Fill Σ μ_a ∂²x_a/∂q_i∂q_j in scaled joints, (n, n).

    Joint i carries the axis of every later one: ∂J_j/∂q_i = z_i × J_j for i ≤ j. A rotation vector's own second
    derivative is the symmetric half of that.
    """
    for i in range(scale.shape[0]):
        x, y, z = J[3, i], J[4, i], J[5, i]
        ux, uy, uz = mu[1] * z - mu[2] * y, mu[2] * x - mu[0] * z, mu[0] * y - mu[1] * x
        vx, vy, vz = mu[4] * z - mu[5] * y, mu[5] * x - mu[3] * z, mu[3] * y - mu[4] * x
        for j in range(i, scale.shape[0]):
            linear = ux * J[0, j] + uy * J[1, j] + uz * J[2, j]
            angular = vx * J[3, j] + vy * J[4, j] + vz * J[5, j]
            C[i, j] = (linear + 0.5 * angular) * scale[i] * scale[j]
            C[j, i] = C[i, j]


@compiled
def _descend(Y: Matrix, C: Matrix, descent: Vector, rank: int, step: Vector) -> None:
    """Add Newton's step in the null space, rows of Y from rank on; where the cost is no bowl, steepest descent's."""
    n, m = Y.shape[0], Y.shape[0] - rank
    B, B_inv, wanted, bent = stack_matrix(m, m), stack_matrix(m, m), stack_vector(m), stack_vector(n)
    for k in range(m):
        for i in range(n):
            bent[i] = dot(C[i], Y[rank + k])
        wanted[k] = descent[rank + k] + dot(bent, step)
        for j in range(m):
            B[k, j] = (1.0 if j == k else 0.0) - dot(bent, Y[rank + j])
    if not spd_inverse(B, B_inv):
        B_inv[:] = 0.0
        for k in range(m):
            B_inv[k, k], wanted[k] = 1.0, descent[rank + k]
    for k in range(m):
        part = dot(B_inv[k], wanted)
        for i in range(n):
            step[i] += part * Y[rank + k, i]
