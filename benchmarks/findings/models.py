"""The arm and the presets of the findings, and the arm's nominal model in many postures."""

import itertools
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import contactsafe as cs
from contactsafe.control.laws import task_inertia, task_nullspace
from contactsafe.experiments.collision_motions import sample_motion
from contactsafe.robot.arm import description_and_tool
from contactsafe.robot.mjcf import arm_mjcf

ARM = cs.robots.panda()
PAPER, VICES, SAFE = cs.presets.paper(), cs.presets.vices(), cs.presets.safe()
FAST = PAPER.with_(
    compensation_gain=50.0, detection_gain=50.0, residual_threshold=2.0, null_damping=3.0, contact_damping=2.0
)
"""The paper's law with a fast observer and damping where (21) leaves none; nothing bounds its torque."""

FAST_BOUNDED = FAST.with_(contact_torque_limit_comply_nm=3.0, contact_torque_limit_reject_nm=3.0)
"""The same with one bound for all contacts."""


class Model(NamedTuple):
    """The arm's nominal model in one posture."""

    q: np.ndarray
    M_inv: np.ndarray
    J: np.ndarray
    J_bar: np.ndarray
    Lambda: np.ndarray
    N_t: np.ndarray
    g: np.ndarray


def model_at(q: np.ndarray, arm: cs.Arm = ARM) -> Model:
    """Evaluate an arm's nominal model at rest at q (n,) rad."""
    nominal = arm.dynamics(q, np.zeros(ARM.n))
    J, M_inv = nominal["J"].copy(), nominal["M_inv"].copy()
    Lambda, J_M_inv = task_inertia(J, M_inv, 0.0, 0.0)
    J_bar = J_M_inv.T @ Lambda
    return Model(q, M_inv, J, J_bar, Lambda, task_nullspace(J, J_bar), nominal["g"].copy())


def postures(count: int) -> list[np.ndarray]:
    """Return postures in which random sweeps and holds begin, away from singularities, (n,) rad each."""
    found: list[np.ndarray] = []
    for seed in itertools.count():
        q = sample_motion(ARM, seed).q_start
        m = model_at(q)
        if np.linalg.det(m.J @ m.M_inv @ m.J.T) > PAPER.impedance.manipulability_floor:
            found.append(q)
        if len(found) == count:
            break
    return found


def scaled_mjcf(mass: float = 1.0, armature: float = 1.0) -> str:
    """Write the arm with its links' masses and its rotors' inertia as multiples of the nominal ones."""
    description, tool = description_and_tool(ARM)
    links = tuple(
        replace(
            link,
            joint=replace(link.joint, armature=armature * link.joint.armature),
            inertia=replace(link.inertia, mass=mass * link.inertia.mass),
        )
        for link in description.links
    )
    return arm_mjcf(replace(description, links=links), tool)
