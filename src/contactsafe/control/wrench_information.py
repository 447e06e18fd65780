"""What sensors tell of a wrench on each link, in the link's own frame: there it adds up over postures.

A joint with axis a through o, both in the frame of a link beyond it, feels w · (f, m) of a force f and a moment m about
the link's origin, w = (o × a, a). Torques τ with standard deviations σ tell of that wrench the information matrix
G = Σ w wᵀ / σ² and the vector h = Σ w τ / σ². A sensor under the base adds six such rows: of a moment about each
axis of the world, felt by w as if a joint turned about it, and of a force along it, felt by w = (a, 0).
"""

import math

import numpy as np

from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import spd_inverse
from contactsafe.core.native import view2
from contactsafe.core.stack import stack_matrix, stack_vector

_f = np.float64


def information_dtype(n: int) -> np.dtype:
    """Describe what is told of a wrench on each link."""
    return np.dtype(
        [
            ("G", _f, (n, 6, 6)),  # 1/N², 1/(N² m), 1/(N m)²
            ("h", _f, (n, 6)),  # 1/N, 1/(N m)
        ]
    )


told_base_dtype = np.dtype(
    [
        ("told", np.int64),  # 0 where nothing is known of it
        ("wrench", _f, (6,)),  # external, about the world's origin, world axes, N and N m
        ("sigma", _f, (6,)),  # its standard deviation
    ]
)
"""Describe what a sensor under the base tells."""


@compiled
def inform(told: Record, handle: Record, torque: Vector, sigma: Vector) -> None:
    """Fill what torques (n,) N m with standard deviations sigma (n,) N m tell of a wrench on each link.

    Args:
        told: `information_dtype` record.
        handle: of the nominal model, up to date.
    """
    n = torque.shape[0]
    for link in range(1, n + 1):
        inform_of(handle, link, torque, sigma, told.G[link - 1], told.h[link - 1])


@compiled
def inform_of(handle: Record, link: int, torque: Vector, sigma: Vector, G: Matrix, h: Vector) -> None:
    """Fill what torques tell of a wrench on one link, G (6, 6) and h (6,)."""
    n, body = torque.shape[0], handle.first_body + link - 1
    xanchor, xaxis = view2(handle.xanchor, n, 3), view2(handle.xaxis, n, 3)
    R, origin = view2(handle.xmat, handle.nbody, 9)[body], view2(handle.xpos, handle.nbody, 3)[body]
    w, o, a = stack_vector(6), stack_vector(3), stack_vector(3)
    G[:], h[:] = 0.0, 0.0
    for i in range(link):
        x, y, z = xanchor[i, 0] - origin[0], xanchor[i, 1] - origin[1], xanchor[i, 2] - origin[2]
        u, v, t = xaxis[i, 0], xaxis[i, 1], xaxis[i, 2]
        for k in range(3):
            o[k] = R[k] * x + R[3 + k] * y + R[6 + k] * z
            a[k] = R[k] * u + R[3 + k] * v + R[6 + k] * t
        w[0], w[1], w[2] = o[1] * a[2] - o[2] * a[1], o[2] * a[0] - o[0] * a[2], o[0] * a[1] - o[1] * a[0]
        w[3], w[4], w[5] = a[0], a[1], a[2]
        weight = 1.0 / (sigma[i] * sigma[i])
        for j in range(6):
            h[j] += weight * torque[i] * w[j]
            for k in range(6):
                G[j, k] += weight * w[j] * w[k]


@compiled
def inform_of_base(told: Record, handle: Record, base: Record) -> None:
    """Add what the wrench at the base tells of a wrench on each link; nothing where it is not known.

    Args:
        told: `information_dtype` record.
        handle: of the nominal model, up to date.
        base: `told_base_dtype` record.
    """
    if base.told == 0:
        return
    w = stack_vector(6)
    for link in range(told.h.shape[0]):
        body, G, h = handle.first_body + link, told.G[link], told.h[link]
        R, origin = view2(handle.xmat, handle.nbody, 9)[body], view2(handle.xpos, handle.nbody, 3)[body]
        for k in range(3):
            axis = R[3 * k : 3 * k + 3]  # of the world in the link's frame
            w[:3], w[3:] = axis, 0.0
            _add(G, h, w, base.wrench[k], base.sigma[k])
            x, y = (k + 1) % 3, (k + 2) % 3
            for j in range(3):  # the axis times where the link is, (e × o) in its frame
                w[j] = R[3 * y + j] * origin[x] - R[3 * x + j] * origin[y]
            w[3:] = axis
            _add(G, h, w, base.wrench[3 + k], base.sigma[3 + k])


@inlined
def _add(G: Matrix, h: Vector, w: Vector, value: float, sigma: float) -> None:
    """Add one row's information."""
    weight = 1.0 / (sigma * sigma)
    for j in range(6):
        h[j] += weight * value * w[j]
        for k in range(6):
            G[j, k] += weight * w[j] * w[k]


@compiled
def marginalise_moment(G: Matrix, h: Vector, variance: float) -> float:
    """Allow for a moment of this variance beside the force: G − G_m K G_mᵀ and h − G_m K h_m, K = (1/s² + G_mm)⁻¹.

    Returns:
        h_m · K h_m / 2 − log det(1 + s² G_mm) / 2.
    """
    S, K, of_moment, Kh = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(6, 3), stack_vector(3)
    for j in range(3):
        for k in range(3):
            S[j, k] = variance * G[3 + j, 3 + k]
        S[j, j] += 1.0
    if not spd_inverse(S, K):
        K[:] = 0.0  # numbers that are none
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
