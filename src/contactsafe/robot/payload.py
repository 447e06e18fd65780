"""What the tool carries: a rigid body held fast, and the arm that has it."""

import copy
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import matrix_to_quat, quat_to_matrix
from contactsafe.robot.arm import Arm, finite_array
from contactsafe.robot.description import Inertia


class Payload(NamedTuple):
    """A rigid body that the tool holds fast.

    Attributes:
        mass: kg.
        com: its centre of mass in the tool's frame, (3,), m.
        inertia: about the centre of mass, in the tool's axes, (3, 3), kg m².
    """

    mass: float
    com: np.ndarray
    inertia: np.ndarray


_REACH_M = 1.0
"""Nothing that a tool holds is further from its point: what is said to be is a slip of units."""


def checked_payload(mass: ArrayLike, com: ArrayLike | None = None, inertia: ArrayLike | None = None) -> Payload:
    """Check what a tool is said to carry.

    Args:
        mass: kg; 0 for nothing.
        com: centre of mass in the tool's frame, (3,), m; None for the tool point.
        inertia: about it, in the tool's axes, (3, 3), kg m²; None for a point.

    Raises:
        InvalidInputError: not finite, a wrong shape, or what no rigid body has.
    """
    kg = float(finite_array(mass, (), "mass"))
    if kg < 0.0:
        raise InvalidInputError(f"mass = {kg:g} kg; give kg ≥ 0, 0 where the tool carries nothing")
    centre = finite_array(np.zeros(3) if com is None else com, (3,), "com")
    reach = float(np.linalg.norm(centre))
    if reach > _REACH_M:
        raise InvalidInputError(f"com is {reach:.4g} m from the tool point, over {_REACH_M:g}; give m, tool's frame")
    tensor = finite_array(np.zeros((3, 3)) if inertia is None else inertia, (3, 3), "inertia")
    slack = 1e-9 + 1e-6 * float(abs(tensor).max())
    if abs(tensor - tensor.T).max() > slack:
        raise InvalidInputError("inertia is not symmetric; give a (3, 3) tensor about the centre of mass, kg m²")
    low, middle, high = (float(moment) for moment in np.linalg.eigvalsh(tensor))
    if low < -slack or high > low + middle + slack:
        raise InvalidInputError(
            f"inertia has the principal moments {low:.4g}, {middle:.4g}, {high:.4g} kg m², and no body has one above "
            "the sum of the others; give it about the centre of mass, in the tool's axes"
        )
    if kg == 0.0 and high > slack:
        raise InvalidInputError("mass is 0 kg but inertia is not; give the mass, or no inertia")
    if high > kg * _REACH_M**2 + slack:
        raise InvalidInputError(
            f"inertia reaches {high:.4g} kg m², more than {kg:g} kg have within {_REACH_M:g} m; give kg m² about the "
            "centre of mass"
        )
    return Payload(kg, centre, tensor)


def carrying(arm: Arm, load: Payload) -> Arm:
    """Return the arm with a payload joined rigidly to what carries its tool point."""
    if load.mass == 0.0:
        return arm
    model = copy.deepcopy(arm.model)
    site = model.site(arm.site).id
    body = model.site_bodyid[site]
    own, R = quat_to_matrix(model.body_iquat[body]), quat_to_matrix(model.site_quat[site])
    joined = Inertia.of(
        float(model.body_mass[body]), model.body_ipos[body], own @ np.diag(model.body_inertia[body]) @ own.T
    ) + Inertia.of(load.mass, model.site_pos[site] + R @ load.com, R @ load.inertia @ R.T)
    set_inertia(model, int(body), joined)
    return replace(arm, model=model)


def set_inertia(model: mujoco.MjModel, body: int, inertia: Inertia) -> None:
    """Give a body of a model, in place, the mass properties that are known in its own frame."""
    moments, axes = np.linalg.eigh(inertia.matrix())
    axes[:, 2] *= np.linalg.det(axes)  # a rotation, not a mirror
    model.body_mass[body], model.body_ipos[body] = inertia.mass, inertia.com
    model.body_inertia[body], model.body_iquat[body] = np.maximum(moments, 0.0), matrix_to_quat(axes)
    model.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    mujoco.mj_setConst(model, mujoco.MjData(model))
