"""Kinematics of a serial arm from its joint axes alone, compiled: a few hundred nanoseconds, nothing shared, no heap.

The product of exponentials (Brockett 1984): what each joint does is a rotation about an axis that is known where all
joints are at zero. `contactsafe.robot.dynamics` asks MuJoCo for the same, at ten times the cost, since it needs masses.
"""

import math
from typing import NamedTuple

import mujoco
import numpy as np

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.stack import stack_matrix
from contactsafe.robot.arm import Arm


class Chain(NamedTuple):
    """An arm at q = 0, world axes.

    Attributes:
        axes: of the joints, unit vectors, (n, 3).
        anchors: a point on each axis, (n, 3), m.
        tool: the tool point, (3,), m.
        frame: the tool's axes, (3, 3).
    """

    axes: np.ndarray
    anchors: np.ndarray
    tool: np.ndarray
    frame: np.ndarray


def chain_of(arm: Arm) -> Chain:
    """Read an arm's chain off its nominal model."""
    data = mujoco.MjData(arm.model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(arm.model, data)
    site = data.site(arm.site)
    return Chain(data.xaxis.copy(), data.xanchor.copy(), site.xpos.copy(), site.xmat.reshape(3, 3).copy())


@compiled
def chain_kinematics(chain: Chain, q: Vector, position: Vector, rotation: Matrix, J: Matrix) -> None:
    """Place the arm at q (n,) and fill the tool point (3,), its axes (3, 3) and its Jacobian (6, n), linear rows first.

    Joint by joint x ↦ R x + p carries what lies beyond from where it is at q = 0; rows of R exp([w] q) by Rodrigues.
    """
    n = q.shape[0]
    R, anchors = stack_matrix(3, 3), stack_matrix(n, 3)
    for a in range(3):
        position[a] = 0.0
        for b in range(3):
            R[a, b] = 1.0 if a == b else 0.0
    for i in range(n):
        w, at = chain.axes[i], chain.anchors[i]
        s, c = math.sin(q[i]), math.cos(q[i])
        for a in range(3):
            x, y, z = R[a, 0], R[a, 1], R[a, 2]
            along = x * w[0] + y * w[1] + z * w[2]
            J[3 + a, i] = along
            anchors[i, a] = position[a] + x * at[0] + y * at[1] + z * at[2]
            R[a, 0] = c * x + s * (y * w[2] - z * w[1]) + (1.0 - c) * along * w[0]
            R[a, 1] = c * y + s * (z * w[0] - x * w[2]) + (1.0 - c) * along * w[1]
            R[a, 2] = c * z + s * (x * w[1] - y * w[0]) + (1.0 - c) * along * w[2]
            position[a] = anchors[i, a] - (R[a, 0] * at[0] + R[a, 1] * at[1] + R[a, 2] * at[2])
    for a in range(3):
        for b in range(3):
            position[a] += R[a, b] * chain.tool[b]
            rotation[a, b] = R[a, 0] * chain.frame[0, b] + R[a, 1] * chain.frame[1, b] + R[a, 2] * chain.frame[2, b]
    for i in range(n):
        x, y, z = position[0] - anchors[i, 0], position[1] - anchors[i, 1], position[2] - anchors[i, 2]
        J[0, i] = J[4, i] * z - J[5, i] * y
        J[1, i] = J[5, i] * x - J[3, i] * z
        J[2, i] = J[3, i] * y - J[4, i] * x
