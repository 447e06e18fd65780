"""Where on an arm something touches it, from the joint torque alone; compiled.

A contact without friction pushes along the surface's normal, so each point of the surface has one direction of joint
torque, t = J_pᵀ n; the point whose t is nearest in angle to the torque found explains it best (Manuelli & Tedrake 2016
do so with particles). Where an arm doubts short lever arms, of points that explain it alike the one that
takes less force. What gives no torque, near a joint's axis, cannot be told apart by anybody.
"""

import math

from numpy import empty, zeros

from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import cross_into, dot, matvec, spd_inverse
from contactsafe.core.native import view2
from contactsafe.robot.surface import SURFACE_COLUMNS

_LEVER_DAMPING, _LEVER_MAX = 1e-4, 1.0  # m², m
_NO_LEVER = 1e-9  # m; a point with less explains no torque, and its square may be too small for a number


@compiled
def contact_lever(handle: Record, link: int, direction: Vector) -> float:
    """Return the lever arm of a contact: joint torque per newton, at a point that stands for the link, m.

    With J_p the Jacobian of the link's centre of mass, the least force there that explains a joint torque τ is
    (J_p J_pᵀ)⁻¹ J_p τ; a little damping keeps it finite where the link cannot be moved along some axis. The handle
    must have been brought up to date by `update_dynamics`.

    Args:
        handle: of the nominal model.
        link: in contact, 1 … n.
        direction: unit joint-space direction of the contact's torque, (n,), N m.
    """
    n = direction.shape[0]
    xanchor, xaxis = view2(handle.xanchor, n, 3), view2(handle.xaxis, n, 3)
    point = view2(handle.xipos, handle.nbody, 3)[handle.first_body + link - 1]
    J, arm = zeros((3, n)), empty(3)
    column = empty(3)
    for i in range(link):
        for k in range(3):
            arm[k] = point[k] - xanchor[i, k]
        cross_into(xaxis[i], arm, column)
        for k in range(3):
            J[k, i] = column[k]
    A, A_inv = zeros((3, 3)), zeros((3, 3))
    for i in range(3):
        for j in range(3):
            A[i, j] = dot(J[i], J[j])
        A[i, i] += _LEVER_DAMPING
    spd_inverse(A, A_inv)
    force = matvec(A_inv, matvec(J, direction))
    size = math.sqrt(dot(force, force))
    return _LEVER_MAX if size * _LEVER_MAX < 1.0 else 1.0 / size


@compiled
def surface_torque(handle: Record, index: int, out: Vector) -> int:
    """Fill the joint torque that 1 N on a point of the surface, inwards along its normal, puts on the arm, (n,), N m.

    Args:
        handle: of the nominal model, brought up to date by `update_dynamics`.
        index: of the point.
        out: (n,).

    Returns:
        The link that the point is on, 1 … n.
    """
    n = out.shape[0]
    row = view2(handle.surface, handle.surface_points, SURFACE_COLUMNS)[index]
    link = int(row[0])
    body = handle.first_body + link - 1
    R = view2(handle.xmat, handle.nbody, 9)[body]
    origin = view2(handle.xpos, handle.nbody, 3)[body]
    xanchor, xaxis = view2(handle.xanchor, n, 3), view2(handle.xaxis, n, 3)
    point, push, arm, moment = empty(3), empty(3), empty(3), empty(3)
    for k in range(3):
        point[k] = origin[k] + R[3 * k] * row[1] + R[3 * k + 1] * row[2] + R[3 * k + 2] * row[3]
        push[k] = -(R[3 * k] * row[4] + R[3 * k + 1] * row[5] + R[3 * k + 2] * row[6])
    for i in range(n):
        out[i] = 0.0
        if i < link:
            for k in range(3):
                arm[k] = point[k] - xanchor[i, k]
            cross_into(arm, push, moment)
            out[i] = dot(xaxis[i], moment)
    return link


@compiled
def best_point(
    handle: Record, start: int, stop: int, torque: Vector, doubted: float, scratch: Vector, best: int, best_fit: float
) -> tuple[int, float]:
    """Return the point that explains a joint torque best, of part of the surface and the best one so far; its fit.

    Args:
        handle: of the nominal model.
        start, stop: points searched.
        torque: of the contact on the arm, (n,), N m.
        doubted: lever arm at which a point is hardly believed to be a contact, m.
        scratch: (n,); overwritten.
        best, best_fit: point of those searched before, −1 for none, and its fit: the cosine between its torque and the
            one found, less where its lever arm is short.
    """
    doubted_squared = doubted * doubted
    for index in range(start, stop):
        surface_torque(handle, index, scratch)
        along = dot(scratch, torque)
        if not along > _NO_LEVER:
            continue
        fit = along / math.sqrt((dot(scratch, scratch) + doubted_squared) * dot(torque, torque))
        if fit > best_fit:
            best, best_fit = index, fit
    return best, best_fit
