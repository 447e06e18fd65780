"""Joint friction: the smooth step in velocity of Gaz et al. 2019; what is viscous, constant or dry beside it."""

import math
from typing import Final

import numpy as np

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled

DRY_STEEP: Final = 40.0
"""How soon dry friction is there, s/rad: nearly all of it at 0.05 rad/s. A controller that compensates a steeper one
chatters at rest."""

FRICTION_FRACTION: Final = 0.8
"""Of the friction that a file declares, what is in the model and compensated; more than there is drives a joint."""


@compiled
def joint_friction(parameters: Matrix, qd: Vector) -> Vector:
    """Return the torque that friction takes from each joint, (n,), N m; see `joint_friction_into`."""
    return joint_friction_into(parameters, qd, np.empty(qd.shape[0]))


@compiled
def joint_friction_into(parameters: Matrix, qd: Vector, out: Vector) -> Vector:
    """Fill the torque that friction takes from each joint, and give it back.

    φ1/(1 + exp(−φ2 (q̇ + φ3))) − φ1/(1 + exp(−φ2 φ3)); Gaz et al. 2019.

    Args:
        parameters: φ1 N m, φ2 s/rad, φ3 rad/s, (n, 3).
        qd: joint velocity, (n,), rad/s.
        out: friction torque, (n,), N m, of the velocity's sign; zero at rest.
    """
    for i in range(qd.shape[0]):
        phi1, phi2, phi3 = parameters[i, 0], parameters[i, 1], parameters[i, 2]
        out[i] = phi1 / (1.0 + math.exp(-phi2 * (qd[i] + phi3))) - phi1 / (1.0 + math.exp(-phi2 * phi3))
    return out


@compiled
def joint_drag_into(friction: Matrix, drag: Matrix, qd: Vector, out: Vector) -> Vector:
    """Fill all torque that is lost at each joint, and give it back: the smooth step, and `drag` beside it.

    Args:
        friction: φ1 N m, φ2 s/rad, φ3 rad/s, (n, 3).
        drag: viscous friction N m s/rad, constant torque N m and dry friction N m, (n, 3). Zeros change no bit.
        qd: joint velocity, (n,), rad/s.
        out: torque, (n,), N m.
    """
    joint_friction_into(friction, qd, out)
    for i in range(qd.shape[0]):
        out[i] += drag[i, 0] * qd[i] + drag[i, 1]
        if drag[i, 2] != 0.0:
            out[i] += drag[i, 2] * math.tanh(0.5 * DRY_STEEP * qd[i])
    return out


@compiled
def joint_drag(friction: Matrix, drag: Matrix, qd: Vector) -> Vector:
    """Return all torque that is lost at each joint, (n,), N m; see `joint_drag_into`."""
    return joint_drag_into(friction, drag, qd, np.empty(qd.shape[0]))
