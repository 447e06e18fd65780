"""Inverse kinematics where the joints are fewer than six: the position, and the orientation nearest to the one asked.

Fewer joints cannot serve all of a pose. Position comes first; of the orientations that its joints then leave the arm,
the nearest is taken.
"""

import math

import numpy as np

from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import dot
from contactsafe.core.rotation import orientation_error
from contactsafe.robot.dynamics import forward_kinematics
from contactsafe.robot.ik_step import limited_step
from contactsafe.robot.posture import POSITION_TOLERANCE

FEW = 6
"""Arms of fewer joints are served so."""

_WEIGHT = 0.03
"""Of rotation against position at first, m/rad: little enough that it costs millimetres, which are then taken off."""

_TURNING, _PLACING = 60, 20
"""Iterations with both at most, and with position alone."""

_SETTLED = 1e-5
"""A step of less ends the first, rad."""


@compiled(nogil=True)
def solve_position_first(
    handle: Record, position: Vector, quat: Vector, q_seed: Vector, q_min: Vector, q_max: Vector, q_out: Vector
) -> tuple[float, float]:
    """Put the tool at a position, and turn it as near to an orientation as its joints then allow.

    Args:
        handle: record of a nominal model that nobody else is using, `handle_dtype`.
        position: of the tool, world, (3,), m.
        quat: of the tool, world, unit w x y z, (4,).
        q_seed: where to start, (n,), rad.
        q_min, q_max: joint limits, (n,), rad.
        q_out: receives the joint positions, (n,), rad; always within the limits.

    Returns:
        Position error in m and rotation error in rad at `q_out`; NaN where the input was not finite.
    """
    n = q_seed.shape[0]
    found, rotation, J = np.empty(3), np.empty((3, 3)), np.empty((6, n))
    error, step = np.empty(6), np.empty(n)
    for i in range(n):
        q_out[i] = min(max(q_seed[i], q_min[i]), q_max[i])
    weight, left = _WEIGHT, _TURNING
    while True:
        forward_kinematics(handle, q_out, found, rotation, J)
        turn = orientation_error(quat, rotation)
        for k in range(3):
            error[k], error[3 + k] = position[k] - found[k], weight * turn[k]
            for i in range(n):
                J[3 + k, i] *= weight
        position_error = math.sqrt(dot(error[:3], error[:3]))
        if (weight == 0.0 and (left == 0 or position_error <= POSITION_TOLERANCE)) or not dot(error, error) < math.inf:
            return position_error, math.sqrt(dot(turn, turn))
        limited_step(J, error, q_out, q_min, q_max, step)
        left -= 1
        if weight > 0.0 and (left == 0 or dot(step, step) < _SETTLED * _SETTLED):
            weight, left = 0.0, _PLACING
        for i in range(n):
            q_out[i] = min(max(q_out[i] + step[i], q_min[i]), q_max[i])
