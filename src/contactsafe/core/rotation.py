"""Rotations in compiled code: unit quaternions w x y z, matrices, rotation vectors."""

import math

import numpy as np

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled


@compiled
def quat_to_matrix(quat: Vector) -> Matrix:
    """Turn a unit quaternion w x y z, (4,), into a rotation matrix, (3, 3)."""
    w, x, y, z = quat[0], quat[1], quat[2], quat[3]
    R = np.empty((3, 3))
    R[0, 0] = 1 - 2 * (y * y + z * z)
    R[0, 1] = 2 * (x * y - w * z)
    R[0, 2] = 2 * (x * z + w * y)
    R[1, 0] = 2 * (x * y + w * z)
    R[1, 1] = 1 - 2 * (x * x + z * z)
    R[1, 2] = 2 * (y * z - w * x)
    R[2, 0] = 2 * (x * z - w * y)
    R[2, 1] = 2 * (y * z + w * x)
    R[2, 2] = 1 - 2 * (x * x + y * y)
    return R


@compiled
def matrix_to_quat(R: Matrix) -> Vector:
    """Turn a rotation matrix, (3, 3), into a unit quaternion w x y z with w ≥ 0, (4,).

    Picks the largest component first, so it is accurate at every angle (Shepperd 1978).
    """
    return matrix_to_quat_into(R, np.empty(4))


@compiled
def matrix_to_quat_into(R: Matrix, quat: Vector) -> Vector:
    """Write the quaternion of `matrix_to_quat` to `quat`, (4,), and give it back."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace > 0.0:
        s = 2.0 * math.sqrt(trace + 1.0)
        quat[0] = 0.25 * s
        quat[1] = (R[2, 1] - R[1, 2]) / s
        quat[2] = (R[0, 2] - R[2, 0]) / s
        quat[3] = (R[1, 0] - R[0, 1]) / s
    else:
        i = 0
        if R[1, 1] > R[0, 0]:
            i = 1
        if R[2, 2] > R[i, i]:
            i = 2
        j = (i + 1) % 3
        k = (i + 2) % 3
        s = 2.0 * math.sqrt(max(1.0 + R[i, i] - R[j, j] - R[k, k], 0.0))
        quat[0] = (R[k, j] - R[j, k]) / s
        quat[1 + i] = 0.25 * s
        quat[1 + j] = (R[j, i] + R[i, j]) / s
        quat[1 + k] = (R[k, i] + R[i, k]) / s
    if quat[0] < 0.0:
        for m in range(4):
            quat[m] = -quat[m]
    return quat


@compiled
def quat_multiply(a: Vector, b: Vector) -> Vector:
    """Give the Hamilton product a b, (4,)."""
    out = np.empty(4)
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    return out


@compiled
def quat_to_rotvec(quat: Vector) -> Vector:
    """Return the rotation vector of a unit quaternion, the shorter one, (3,), rad."""
    out = np.empty(3)
    sign = 1.0 if quat[0] >= 0.0 else -1.0
    norm = math.sqrt(quat[1] * quat[1] + quat[2] * quat[2] + quat[3] * quat[3])
    scale = 2.0 * sign
    if norm > 1e-12:
        scale = 2.0 * sign * math.atan2(norm, abs(quat[0])) / norm
    for i in range(3):
        out[i] = scale * quat[1 + i]
    return out


@compiled
def rotvec_to_quat(rotvec: Vector) -> Vector:
    """Give the unit quaternion of a rotation vector, (3,) rad to (4,)."""
    out = np.empty(4)
    angle = math.sqrt(rotvec[0] ** 2 + rotvec[1] ** 2 + rotvec[2] ** 2)
    scale = 0.5
    if angle > 1e-9:
        scale = math.sin(0.5 * angle) / angle
    out[0] = math.cos(0.5 * angle)
    for i in range(3):
        out[1 + i] = scale * rotvec[i]
    return out


@compiled
def orientation_error(quat_d: Vector, R: Matrix) -> Vector:
    """Give the rotation vector of R_d Rᵀ in world axes, (3,), rad.

    Args:
        quat_d: desired orientation, unit quaternion w x y z, (4,).
        R: actual orientation, (3, 3).
    """
    actual = matrix_to_quat(R)
    for i in range(1, 4):
        actual[i] = -actual[i]
    return quat_to_rotvec(quat_multiply(quat_d, actual))
