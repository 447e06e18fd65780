"""Evidence: how well a contact at a place explains the external torque of the joints, over all forces there may be.

A contact at a point p with a force f puts τ = J_pᵀ f on the joints. f is Gaussian, along the inward normal by some tens
of newtons and across it by what friction allows, or in any direction at the tool; what the residual then says for the
point has a closed form. A place stands for what is about it: a contact beside it has a moment there as well, known to
be small.
"""

import math
from typing import NamedTuple

from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot
from contactsafe.core.native import view1, view2
from contactsafe.core.stack import stack_matrix, stack_vector
from contactsafe.robot.surface import SURFACE_COLUMNS

_NORMAL_N, _ACROSS_N = 30.0, 10.0
"""Standard deviations of a contact's force along the surface's normal and across it."""

_GRID_M = 0.012
"""By which a contact is beside the nearest of the grid's points, standard deviation along an axis."""

_LEVER_M = 0.5
"""Lever arm by which a torque is taken for a force, where no more than its size matters."""

_Z_99 = 2.3263
"""A normal distribution exceeds so many standard deviations once in a hundred."""

_LOGISTIC = 1.702
"""Of a logistic distribution that is nearly the normal one."""


class Uncertainty(NamedTuple):
    """How well the torque of a contact is known.

    Attributes:
        sigma: standard deviation of each joint's, (n,), N m.
        moment_variance: of the moment that a contact beside a point of the grid has about it, N² m².
    """

    sigma: Vector
    moment_variance: float


@compiled
def moment_variance(torque: Vector) -> float:
    """Return the variance of the moment that a contact has about the nearest point of the grid, N² m²."""
    return moment_variance_of(math.sqrt(dot(torque, torque)) / _LEVER_M)


@compiled
def moment_variance_of(force: float) -> float:
    """Return the same where the force is known, N² m²."""
    return (_GRID_M * force) ** 2 + 1e-6


@compiled
def place_into(handle: Record, index: int, n: int, point: Vector, normal: Vector) -> int:
    """Fill a place and its outward normal in the frame of its link, the last one for the tool, (3,), m.

    Returns:
        The link, n + 1 for the tool.
    """
    row = view2(handle.places, handle.place_points, SURFACE_COLUMNS)[index]
    if index < handle.place_points - handle.tool_places:
        point[:], normal[:] = row[1:4], row[4:7]
        return int(row[0])
    R, origin = view2(handle.site_xmat, handle.site + 1, 9)[handle.site], _site(handle)
    p, m, at, body = stack_vector(3), stack_vector(3), _frame(handle, n)[1], _frame(handle, n)[0]
    for k in range(3):
        p[k] = origin[k] - at[k] + R[3 * k] * row[1] + R[3 * k + 1] * row[2] + R[3 * k + 2] * row[3]
        m[k] = R[3 * k] * row[4] + R[3 * k + 1] * row[5] + R[3 * k + 2] * row[6]
    for k in range(3):
        point[k] = body[k] * p[0] + body[3 + k] * p[1] + body[6 + k] * p[2]
        normal[k] = body[k] * m[0] + body[3 + k] * m[1] + body[6 + k] * m[2]
    return n + 1


@inlined
def _site(handle: Record) -> Vector:
    return view2(handle.site_xpos, handle.site + 1, 3)[handle.site]


@inlined
def _frame(handle: Record, link: int) -> tuple[Vector, Vector]:
    """Return rotation (9,) and origin (3,) of a link, world."""
    body = handle.first_body + link - 1
    return view2(handle.xmat, handle.nbody, 9)[body], view2(handle.xpos, handle.nbody, 3)[body]


@compiled
def to_world(handle: Record, link: int, point: Vector, vector: Vector) -> None:
    """Turn a point and a vector in a link's frame, (3,), into those of the world, in place."""
    R, origin = _frame(handle, link)
    p, v = stack_vector(3), stack_vector(3)
    p[:], v[:] = point, vector
    for k in range(3):
        point[k] = origin[k] + R[3 * k] * p[0] + R[3 * k + 1] * p[1] + R[3 * k + 2] * p[2]
        vector[k] = R[3 * k] * v[0] + R[3 * k + 1] * v[1] + R[3 * k + 2] * v[2]


@inlined
def link_of(handle: Record, index: int, n: int) -> int:
    """Return the link of a place, 1 … n, n + 1 for the tool."""
    if index >= handle.place_points - handle.tool_places:
        return n + 1
    return int(view1(handle.places, SURFACE_COLUMNS * (index + 1))[SURFACE_COLUMNS * index])


@inlined
def _evidence(G: Matrix, h: Vector, p: Vector, normal: Vector, is_tool: bool, A: Matrix, b: Vector, f: Vector) -> float:
    """Return the log of how well a point explains the torque, up to a constant; fill the likeliest force f there.

    With S the covariance of the force beforehand and m = p × f, A = Tᵀ G T + S⁻¹, b = Tᵀ h, T = (1, [p]×):
    log = b · A⁻¹ b / 2 − log det(A S) / 2, and the force pushes inwards.
    """
    across, along = 1.0 / (_NORMAL_N if is_tool else _ACROSS_N) ** 2, 1.0 / _NORMAL_N**2
    for j in range(3):
        u, v = (j + 1) % 3, (j + 2) % 3
        b[j] = h[j] + p[v] * h[3 + u] - p[u] * h[3 + v]
        for k in range(3):
            x, y = (k + 1) % 3, (k + 2) % 3
            A[j, k] = G[j, k] + p[v] * G[3 + u, k] - p[u] * G[3 + v, k]
            A[j, k] += p[y] * (G[j, 3 + x] + p[v] * G[3 + u, 3 + x] - p[u] * G[3 + v, 3 + x])
            A[j, k] -= p[x] * (G[j, 3 + y] + p[v] * G[3 + u, 3 + y] - p[u] * G[3 + v, 3 + y])
            A[j, k] += (along - across) * normal[j] * normal[k]
        A[j, j] += across
    determinant, variance = _solve(A, b, normal, f)
    log = 0.5 * (b[0] * f[0] + b[1] * f[1] + b[2] * f[2]) - 0.5 * math.log(determinant)
    log += 0.5 * math.log(across * across * along)
    if is_tool:
        return log
    # twice the part of the force's distribution that pushes inwards, with a logistic's tail
    z = _LOGISTIC * (normal[0] * f[0] + normal[1] * f[1] + normal[2] * f[2]) / math.sqrt(variance)
    return log - (z if z > 30.0 else math.log(1.0 + math.exp(z))) + math.log(2.0)


@inlined
def _solve(A: Matrix, b: Vector, normal: Vector, f: Vector) -> tuple[float, float]:
    """Fill f = A⁻¹ b by Cramer's rule; return det A, and n · A⁻¹ n."""
    c00, c01 = A[1, 1] * A[2, 2] - A[1, 2] * A[1, 2], A[0, 2] * A[1, 2] - A[0, 1] * A[2, 2]
    c11, c12 = A[0, 0] * A[2, 2] - A[0, 2] * A[0, 2], A[0, 1] * A[0, 2] - A[0, 0] * A[1, 2]
    c22, c02 = A[0, 0] * A[1, 1] - A[0, 1] * A[0, 1], A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1]
    determinant = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    f[0] = (c00 * b[0] + c01 * b[1] + c02 * b[2]) / determinant
    f[1] = (c01 * b[0] + c11 * b[1] + c12 * b[2]) / determinant
    f[2] = (c02 * b[0] + c12 * b[1] + c22 * b[2]) / determinant
    x, y, z = normal[0], normal[1], normal[2]
    squared = c00 * x * x + c11 * y * y + c22 * z * z + 2.0 * (c01 * x * y + c02 * x * z + c12 * y * z)
    return determinant, squared / determinant


@compiled
def compare_into(handle: Record, told: Record, constant: Vector, start: int, stop: int, log: Vector) -> None:
    """Fill the evidence of part of the places, in the same part of `log`, up to a constant of all.

    Args:
        handle: of the nominal model, up to date.
        told: of a wrench on each link, the moment beside the place taken out; `information_dtype` record.
        constant: that `marginalise_moment` returned for each link, (n,).
        start, stop: places compared.
        log: (at least stop,).
    """
    n = constant.shape[0]
    A, b, f, point, normal = stack_matrix(3, 3), stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    for index in range(start, stop):
        link = place_into(handle, index, n, point, normal)
        k = min(link, n) - 1
        log[index] = constant[k] + _evidence(told.G[k], told.h[k], point, normal, link > n, A, b, f)


@compiled
def force_into(handle: Record, told: Record, index: int, n: int, point: Vector, force: Vector) -> float:
    """Fill a place, world, (3,), m, and the likeliest force there, world, (3,), N; return its evidence.

    Args:
        handle: of the nominal model, up to date.
        told: as in `compare_into`; up to the constant of the link.
        index: of the place.
        n: number of joints.
    """
    A, b, normal = stack_matrix(3, 3), stack_vector(3), stack_vector(3)
    link = place_into(handle, index, n, point, normal)
    k = min(link, n)
    found = _evidence(told.G[k - 1], told.h[k - 1], point, normal, link > n, A, b, force)
    to_world(handle, k, point, force)
    return found


@compiled
def left_over(handle: Record, link: int, torque: Vector, known: Uncertainty, point: Vector, force: Vector) -> float:
    """Return what a force on a link leaves over of a torque, Σ (τ − J_pᵀ f)² / (σ² + s²).

    Args:
        handle: of the nominal model, up to date.
        link: 1 … n.
        torque, known: external, (n,), N m, and how well it is known.
        point, force: world, (3,) m and N.
    """
    n, squared = torque.shape[0], 0.0
    xanchor, xaxis = view2(handle.xanchor, n, 3), view2(handle.xaxis, n, 3)
    for i in range(n):
        o, a, left = xanchor[i], xaxis[i], torque[i]
        if i < link:
            x, y, z = point[0] - o[0], point[1] - o[1], point[2] - o[2]
            left -= a[0] * (y * force[2] - z * force[1])
            left -= a[1] * (z * force[0] - x * force[2]) + a[2] * (x * force[1] - y * force[0])
        squared += left * left / (known.sigma[i] * known.sigma[i] + known.moment_variance)
    return squared


@compiled
def base_left_over(base: Record, moment_variance: float, point: Vector, force: Vector) -> float:
    """Return what a force leaves over of the wrench at the base, as `left_over` does of the joints' torque.

    Args:
        base: `told_base_dtype` record, its wrench known.
        moment_variance: as of `Uncertainty`, N² m².
        point, force: world, (3,) m and N.
    """
    squared = 0.0
    for k in range(3):
        u, v = (k + 1) % 3, (k + 2) % 3
        left = base.wrench[k] - force[k]
        turned = base.wrench[3 + k] - (point[u] * force[v] - point[v] * force[u])
        squared += left * left / (base.sigma[k] * base.sigma[k])
        squared += turned * turned / (base.sigma[3 + k] * base.sigma[3 + k] + moment_variance)
    return squared


@compiled
def most_by_noise(free: float) -> float:
    """Return what so many squared standard normal numbers exceed once in a hundred; Wilson & Hilferty 1931."""
    return free * (1.0 - 2.0 / (9.0 * free) + _Z_99 * math.sqrt(2.0 / (9.0 * free))) ** 3
