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
from contactsafe.core.linalg import dot, spd_inverse
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
    force = math.sqrt(dot(torque, torque)) / _LEVER_M
    return (_GRID_M * force) ** 2 + 1e-6


@compiled
def point_into(handle: Record, index: int, n: int, point: Vector, normal: Vector) -> int:
    """Fill a point of the surface and its outward normal, world, (3,), m; return its link, n + 1 for the tool."""
    row = view2(handle.places, handle.place_points, SURFACE_COLUMNS)[index]
    if index >= handle.place_points - handle.tool_places:
        link, site = n + 1, handle.site
        R, origin = view2(handle.site_xmat, site + 1, 9)[site], view2(handle.site_xpos, site + 1, 3)[site]
    else:
        link = int(row[0])
        body = handle.first_body + link - 1
        R, origin = view2(handle.xmat, handle.nbody, 9)[body], view2(handle.xpos, handle.nbody, 3)[body]
    for k in range(3):
        point[k] = origin[k] + R[3 * k] * row[1] + R[3 * k + 1] * row[2] + R[3 * k + 2] * row[3]
        normal[k] = R[3 * k] * row[4] + R[3 * k + 1] * row[5] + R[3 * k + 2] * row[6]
    return link


@inlined
def link_of(handle: Record, index: int, n: int) -> int:
    """Return the link of a place, 1 … n, n + 1 for the tool."""
    if index >= handle.place_points - handle.tool_places:
        return n + 1
    return int(view1(handle.places, SURFACE_COLUMNS * (index + 1))[SURFACE_COLUMNS * index])


@compiled
def _information(handle: Record, torque: Vector, known: Uncertainty, joints: int, G: Matrix, h: Vector) -> float:
    """Fill what a torque tells of a wrench about the origin on a link, G (6, 6) and h (6,); return a constant of it.

    A joint with axis a through o feels w · (f, m), w = (o × a, a): G = Σ w wᵀ / σ², h = Σ w τ / σ².
    """
    n = torque.shape[0]
    xanchor, xaxis, w = view2(handle.xanchor, n, 3), view2(handle.xaxis, n, 3), stack_vector(6)
    G[:], h[:] = 0.0, 0.0
    for i in range(joints):
        o, a, weight = xanchor[i], xaxis[i], 1.0 / (known.sigma[i] * known.sigma[i])
        w[0], w[1], w[2] = o[1] * a[2] - o[2] * a[1], o[2] * a[0] - o[0] * a[2], o[0] * a[1] - o[1] * a[0]
        w[3], w[4], w[5] = a[0], a[1], a[2]
        for j in range(6):
            h[j] += weight * torque[i] * w[j]
            for k in range(6):
                G[j, k] += weight * w[j] * w[k]
    return _marginalise_moment(G, h, known.moment_variance)


@compiled
def _marginalise_moment(G: Matrix, h: Vector, variance: float) -> float:
    """Allow for a moment of this variance beside the force: G − G_m K G_mᵀ and h − G_m K h_m, K = (1/s² + G_mm)⁻¹.

    Returns:
        h_m · K h_m / 2 − log det(1 + s² G_mm) / 2.
    """
    S, K, of_moment, Kh = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(6, 3), stack_vector(3)
    for j in range(3):
        for k in range(3):
            S[j, k] = variance * G[3 + j, 3 + k]
        S[j, j] += 1.0
    spd_inverse(S, K)
    constant = -0.5 * math.log(_determinant(S))
    for k in range(3):
        Kh[k] = variance * (K[k, 0] * h[3] + K[k, 1] * h[4] + K[k, 2] * h[5])
        constant += 0.5 * Kh[k] * h[3 + k]
    of_moment[:] = G[:, 3:]
    for j in range(6):
        m = of_moment[j]
        h[j] -= m[0] * Kh[0] + m[1] * Kh[1] + m[2] * Kh[2]
        for k in range(6):
            for x in range(3):
                G[j, k] -= variance * of_moment[k, x] * (m[0] * K[0, x] + m[1] * K[1, x] + m[2] * K[2, x])
    return constant


@inlined
def _determinant(S: Matrix) -> float:
    return (
        S[0, 0] * (S[1, 1] * S[2, 2] - S[1, 2] * S[2, 1])
        - S[0, 1] * (S[1, 0] * S[2, 2] - S[1, 2] * S[2, 0])
        + S[0, 2] * (S[1, 0] * S[2, 1] - S[1, 1] * S[2, 0])
    )


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
def compare_into(handle: Record, torque: Vector, known: Uncertainty, start: int, stop: int, log: Vector) -> None:
    """Fill the evidence of part of the places, in the same place of `log`, up to a constant of all.

    Args:
        handle: of the nominal model, up to date.
        torque: external, (n,), N m.
        known: how well.
        start, stop: places compared.
        log: (at least stop,).
    """
    n = torque.shape[0]
    G, h, A, b, f = stack_matrix(6, 6), stack_vector(6), stack_matrix(3, 3), stack_vector(3), stack_vector(3)
    point, normal = stack_vector(3), stack_vector(3)
    of_link, constant = -1, 0.0
    for index in range(start, stop):
        link = point_into(handle, index, n, point, normal)
        if min(link, n) != of_link:
            of_link = min(link, n)
            constant = _information(handle, torque, known, of_link, G, h)
        log[index] = constant + _evidence(G, h, point, normal, link > n, A, b, f)


@compiled
def force_into(handle: Record, index: int, torque: Vector, known: Uncertainty, point: Vector, force: Vector) -> float:
    """Fill a point of the surface, world, (3,), m, and the likeliest force there, (3,), N; return its evidence."""
    n = torque.shape[0]
    G, h, A, b, normal = stack_matrix(6, 6), stack_vector(6), stack_matrix(3, 3), stack_vector(3), stack_vector(3)
    link = point_into(handle, index, n, point, normal)
    constant = _information(handle, torque, known, min(link, n), G, h)
    return constant + _evidence(G, h, point, normal, link > n, A, b, force)


@compiled
def left_over(handle: Record, index: int, torque: Vector, known: Uncertainty, point: Vector, force: Vector) -> float:
    """Return what of a torque the likeliest force at a place leaves over, Σ (τ − J_pᵀ f)² / (σ² + s²).

    Where that is the place it is about n − 3 large. Point and force are filled as by `force_into`.
    """
    n, squared = torque.shape[0], 0.0
    force_into(handle, index, torque, known, point, force)
    joints = min(link_of(handle, index, n), n)
    xanchor, xaxis = view2(handle.xanchor, n, 3), view2(handle.xaxis, n, 3)
    for i in range(n):
        o, a, left = xanchor[i], xaxis[i], torque[i]
        if i < joints:
            x, y, z = point[0] - o[0], point[1] - o[1], point[2] - o[2]
            left -= a[0] * (y * force[2] - z * force[1])
            left -= a[1] * (z * force[0] - x * force[2]) + a[2] * (x * force[1] - y * force[0])
        squared += left * left / (known.sigma[i] * known.sigma[i] + known.moment_variance)
    return squared


@compiled
def most_by_noise(free: float) -> float:
    """Return what so many squared standard normal numbers exceed once in a hundred; Wilson & Hilferty 1931."""
    return free * (1.0 - 2.0 / (9.0 * free) + _Z_99 * math.sqrt(2.0 / (9.0 * free))) ** 3
