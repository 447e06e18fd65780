"""Localisation: where on the arm or its tool something touches it, and with what force, as far as torques can tell.

A contact at a point p with a force f puts τ = J_pᵀ f on the joints. For each point of the surface f is Gaussian, along
the inward normal by some tens of newtons and across it by what friction allows; what the residual then says for the
point, over all forces, has a closed form. Points are compared by it: a grid filter, in place of the particles of
Manuelli & Tedrake 2016. The points of the grid stand for what is about them: a contact beside one has a moment there as
well, known to be small. Several points may explain the torques of one posture alike; as the arm moves on, what the
postures before said is remembered, and the set shrinks.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot, spd_inverse
from contactsafe.core.native import view1, view2
from contactsafe.core.stack import stack_matrix, stack_vector
from contactsafe.robot.surface import SURFACE_COLUMNS

_f = np.float64
_i = np.int64

MAX_POINTS = 704
"""Points of an arm and its tool that a record has room for."""

_POINTS_A_S = 1e5
"""That are compared in a second: all of a Panda's in 5 ms."""

_NORMAL_N, _ACROSS_N = 30.0, 10.0
"""Standard deviations of a contact's force along the surface's normal and across it."""

_GRID_M = 0.012
"""By which a contact is beside the nearest of the grid's points, standard deviation along an axis."""

_LEVER_M = 0.5
"""Lever arm by which a torque is taken for a force, where no more than its size matters."""

_MOVED_RAD = 0.2
"""By so much another posture says something new."""

_POSTURES = 5.0
"""As many are remembered at most, the older the less: a contact may slide."""

_ABOUT_M, _NEGLIGIBLE = 0.05, 0.02
"""Point and force are a mean over what is so near to the best point, and no less probable than this part of it."""

_NEVER = -1e9


class Spread(NamedTuple):
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


def localisation_dtype(n: int) -> np.dtype:
    """Describe what is known of a contact's place."""
    return np.dtype(
        [
            ("now", _f, (MAX_POINTS,)),  # log of how well each point explains the torques of this sweep, so far
            ("memory", _f, (MAX_POINTS,)),  # the same of earlier postures, their sum
            ("postures", _f),  # that are remembered
            ("log", _f, (MAX_POINTS,)),  # of how probable each point was after the last whole sweep, up to a constant
            ("next", _i),  # point to be compared next
            ("torque", _f, (n,)),  # with which all points of a sweep are compared, N m
            ("sigma", _f, (n,)),  # its standard deviation, N m
            ("moment_variance", _f),  # see `Spread`
            ("tool_prior", _f),  # probability of the tool beforehand
            ("turn", _i),  # sweeps over all points since the contact began
            ("q", _f, (n,)),  # posture that was added to the memory last, rad
            ("best", _i),  # most probable point of the most probable link, −1 for none
            ("link", _i),  # that link, n + 1 for the tool, 0 for none
            ("tool_probability", _f),  # of the tool
            ("link_probability", _f),  # of the link
            ("force", _f, (3,)),  # of the environment at the best point, world, N
            ("point", _f, (3,)),  # the best point, world, m
        ]
    )


@compiled
def forget_place(place: Record, q: Vector) -> None:
    """Begin with a contact that may be anywhere."""
    place.memory[:], place.postures, place.next, place.turn, place.q[:] = 0.0, 0.0, 0, 0, q
    place.best, place.link, place.tool_probability, place.link_probability = -1, 0, 0.0, 0.0
    place.force[:], place.point[:] = 0.0, 0.0


@compiled
def localise(
    place: Record, handle: Record, torque: Vector, known: Spread, q: Vector, tool_prior: float, dt: float
) -> None:
    """Compare the next points of the surface, all of them in the first tick of a contact.

    Args:
        place: `localisation_dtype` record; advanced.
        handle: of the nominal model, up to date.
        torque: external, (n,), N m.
        known: how well the torque is known.
        q: posture, (n,), rad.
        tool_prior: probability of the tool before anything is known.
        dt: that passed, s.
    """
    points = min(handle.place_points, MAX_POINTS)
    if place.next == 0:
        place.torque[:], place.sigma[:], place.moment_variance = torque, known.sigma, known.moment_variance
        place.tool_prior = tool_prior
    stop = points if place.turn == 0 else min(place.next + round(_POINTS_A_S * dt), points)
    of_sweep = Spread(place.sigma, place.moment_variance)
    _compare(place, handle, place.torque, of_sweep, place.next, stop)
    place.next = stop
    if stop < points:
        return
    place.next, place.turn = 0, place.turn + 1
    _remember(place, q, points)
    _conclude(place, handle, place.torque, of_sweep, points)


@compiled
def _compare(place: Record, handle: Record, torque: Vector, known: Spread, start: int, stop: int) -> None:
    """Compute how well each point of a part of the surface explains the torque; its log."""
    n = torque.shape[0]
    G, h, A, b, f = stack_matrix(6, 6), stack_vector(6), stack_matrix(3, 3), stack_vector(3), stack_vector(3)
    point, normal = stack_vector(3), stack_vector(3)
    of_link, constant = -1, 0.0
    for index in range(start, stop):
        link = point_into(handle, index, n, point, normal)
        joints = min(link, n)
        if joints != of_link:
            constant = _information(handle, torque, known, joints, G, h)
            of_link = joints
        place.now[index] = constant + _evidence(G, h, point, normal, link > n, A, b, f)


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


@compiled
def _information(handle: Record, torque: Vector, known: Spread, joints: int, G: Matrix, h: Vector) -> float:
    """Fill what a torque tells of a wrench about the origin on a link, G (6, 6) and h (6,); return a constant of it.

    A joint with axis a through o feels w · (f, m), w = (o × a, a): G = Σ w wᵀ / σ², h = Σ w τ / σ². A small moment of
    standard deviation s beside it is marginalised: with K = (1/s² + G_mm)⁻¹, G − G_m K G_mᵀ, h − G_m K h_m, and the
    constant h_m · K h_m / 2 − log det(1 + s² G_mm) / 2.
    """
    n = torque.shape[0]
    xanchor, xaxis = view2(handle.xanchor, n, 3), view2(handle.xaxis, n, 3)
    w, S, K, GK, Kh = stack_vector(6), stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(6, 3), stack_vector(3)
    G[:], h[:] = 0.0, 0.0
    for i in range(joints):
        o, a, weight = xanchor[i], xaxis[i], 1.0 / (known.sigma[i] * known.sigma[i])
        w[0], w[1], w[2] = o[1] * a[2] - o[2] * a[1], o[2] * a[0] - o[0] * a[2], o[0] * a[1] - o[1] * a[0]
        w[3], w[4], w[5] = a[0], a[1], a[2]
        for j in range(6):
            h[j] += weight * torque[i] * w[j]
            for k in range(6):
                G[j, k] += weight * w[j] * w[k]
    for j in range(3):
        for k in range(3):
            S[j, k] = G[3 + j, 3 + k]
        S[j, j] += 1.0 / known.moment_variance
    spd_inverse(S, K)
    constant = -0.5 * (math.log(_det3(S)) + 3.0 * math.log(known.moment_variance))
    for k in range(3):
        Kh[k] = K[k, 0] * h[3] + K[k, 1] * h[4] + K[k, 2] * h[5]
        constant += 0.5 * Kh[k] * h[3 + k]
        for j in range(6):
            GK[j, k] = G[j, 3] * K[0, k] + G[j, 4] * K[1, k] + G[j, 5] * K[2, k]
    S6 = stack_matrix(6, 3)
    for j in range(6):
        h[j] -= G[j, 3] * Kh[0] + G[j, 4] * Kh[1] + G[j, 5] * Kh[2]
        for k in range(3):
            S6[j, k] = G[j, 3 + k]
    for j in range(6):
        for k in range(6):
            G[j, k] -= GK[j, 0] * S6[k, 0] + GK[j, 1] * S6[k, 1] + GK[j, 2] * S6[k, 2]
    return constant


@inlined
def _det3(S: Matrix) -> float:
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
    across, along = 1.0 / (_ACROSS_N * _ACROSS_N), 1.0 / (_NORMAL_N * _NORMAL_N)
    if is_tool:
        across = along
    for j in range(3):
        # row j of Tᵀ G: of the force, and of the moment that it has about the origin
        u, v = (j + 1) % 3, (j + 2) % 3
        b[j] = h[j] + p[v] * h[3 + u] - p[u] * h[3 + v]
        for k in range(3):
            x, y = (k + 1) % 3, (k + 2) % 3
            A[j, k] = G[j, k] + p[v] * G[3 + u, k] - p[u] * G[3 + v, k]
            A[j, k] += p[y] * (G[j, 3 + x] + p[v] * G[3 + u, 3 + x] - p[u] * G[3 + v, 3 + x])
            A[j, k] -= p[x] * (G[j, 3 + y] + p[v] * G[3 + u, 3 + y] - p[u] * G[3 + v, 3 + y])
            A[j, k] += (along - across) * normal[j] * normal[k]
        A[j, j] += across
    # Cramer's rule: A is symmetric, positive definite
    c00, c01, c02 = (
        A[1, 1] * A[2, 2] - A[1, 2] * A[1, 2],
        A[0, 2] * A[1, 2] - A[0, 1] * A[2, 2],
        A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1],
    )
    c11, c12 = A[0, 0] * A[2, 2] - A[0, 2] * A[0, 2], A[0, 1] * A[0, 2] - A[0, 0] * A[1, 2]
    c22 = A[0, 0] * A[1, 1] - A[0, 1] * A[0, 1]
    determinant = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    f[0] = (c00 * b[0] + c01 * b[1] + c02 * b[2]) / determinant
    f[1] = (c01 * b[0] + c11 * b[1] + c12 * b[2]) / determinant
    f[2] = (c02 * b[0] + c12 * b[1] + c22 * b[2]) / determinant
    log = 0.5 * (b[0] * f[0] + b[1] * f[1] + b[2] * f[2]) - 0.5 * math.log(determinant)
    log += 0.5 * math.log(across * across * along)
    if is_tool:
        return log
    inwards = -(normal[0] * f[0] + normal[1] * f[1] + normal[2] * f[2])
    variance = (
        normal[0] * (c00 * normal[0] + 2.0 * (c01 * normal[1] + c02 * normal[2]))
        + normal[1] * (c11 * normal[1] + 2.0 * c12 * normal[2])
        + c22 * normal[2] * normal[2]
    ) / determinant
    # the normal distribution's tail as a logistic's
    z = -1.702 * inwards / math.sqrt(variance)
    return log - (z if z > 30.0 else math.log(1.0 + math.exp(z))) + math.log(2.0)


@compiled
def _remember(place: Record, q: Vector, points: int) -> None:
    """Add what the torques of now say to the memory, once the arm is elsewhere."""
    moved = 0.0
    for i in range(q.shape[0]):
        moved += (q[i] - place.q[i]) ** 2
    if moved < _MOVED_RAD * _MOVED_RAD:
        return
    place.q[:] = q
    best = _NEVER
    for index in range(points):
        best = max(best, place.now[index])
    keep = min(1.0, (_POSTURES - 1.0) / max(place.postures, 1.0))
    place.postures = keep * place.postures + 1.0
    for index in range(points):
        place.memory[index] = keep * place.memory[index] + (place.now[index] - best)


@compiled
def _conclude(place: Record, handle: Record, torque: Vector, known: Spread, points: int) -> None:
    """Find the most probable link, the most probable point of it, and the force there.

    The errors of several postures are alike, a sensor's bias or a link's mass: what they say is added up as if there
    were only as many as the root of their number.
    """
    n, tool = torque.shape[0], max(handle.tool_places, 1)
    probability = stack_vector(n + 2)
    of_arm = math.log((1.0 - place.tool_prior) / max(points - tool, 1))
    of_tool = math.log(place.tool_prior / tool)
    alike = math.sqrt(place.postures + 1.0)
    probability[:] = 0.0
    best, total = _NEVER, 0.0
    for index in range(points):
        prior = of_tool if index >= handle.place_points - handle.tool_places else of_arm
        place.log[index] = (place.now[index] + place.memory[index]) / alike + prior
        best = max(best, place.log[index])
    for index in range(points):
        weight = math.exp(max(place.log[index] - best, -60.0))
        probability[_link_of(handle, index, n)] += weight
        total += weight
    link = 0
    for candidate in range(1, n + 2):
        if probability[candidate] > probability[link]:
            link = candidate
    place.link, place.best = link, -1
    place.link_probability, place.tool_probability = probability[link] / total, probability[n + 1] / total
    best = 2.0 * _NEVER
    for index in range(points):
        if _link_of(handle, index, n) == link and place.log[index] > best:
            best, place.best = place.log[index], index
    _average(place, handle, torque, known, points)


@compiled
def _average(place: Record, handle: Record, torque: Vector, known: Spread, points: int) -> None:
    """Set point and force to the mean over the points about the best one, on the same part, by their probability."""
    n, best, total = torque.shape[0], place.log[place.best], 0.0
    point, force, normal, centre = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    point_into(handle, place.best, n, centre, normal)
    place.point[:], place.force[:] = 0.0, 0.0
    for index in range(points):
        weight = math.exp(max(place.log[index] - best, -60.0))
        if weight < _NEGLIGIBLE or point_into(handle, index, n, point, normal) != place.link:
            continue
        if (point[0] - centre[0]) ** 2 + (point[1] - centre[1]) ** 2 + (point[2] - centre[2]) ** 2 > _ABOUT_M**2:
            continue
        force_into(handle, index, torque, known, point, force)
        total += weight
        for k in range(3):
            place.point[k] += weight * point[k]
            place.force[k] += weight * force[k]
    for k in range(3):
        place.point[k] /= total
        place.force[k] /= total


@inlined
def _link_of(handle: Record, index: int, n: int) -> int:
    if index >= handle.place_points - handle.tool_places:
        return n + 1
    return int(view1(handle.places, SURFACE_COLUMNS * (index + 1))[SURFACE_COLUMNS * index])


@compiled
def force_into(handle: Record, index: int, torque: Vector, known: Spread, point: Vector, force: Vector) -> float:
    """Fill a point of the surface, world, (3,), m, and the likeliest force there, (3,), N; return its evidence."""
    n = torque.shape[0]
    G, h, A, b, normal = stack_matrix(6, 6), stack_vector(6), stack_matrix(3, 3), stack_vector(3), stack_vector(3)
    link = point_into(handle, index, n, point, normal)
    constant = _information(handle, torque, known, min(link, n), G, h)
    return constant + _evidence(G, h, point, normal, link > n, A, b, force)
