"""Worlds that the tests of this room share: an arm over a plate, its targets set by hand."""

from functools import cache

import mujoco
import numpy as np

from contactsafe.control import presets
from contactsafe.robot import robots
from contactsafe.robot.arm import Pose
from contactsafe.robot.ik import InverseKinematics
from contactsafe.sim.config import NO_NOISE, WorldConfig
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds

DOWN = np.array([0.0, 1.0, 0.0, 0.0])
"""A tool that points straight down, w x y z."""

BOARD_Z = 0.01
CALM = WorldConfig(sensors=NO_NOISE)
"""No noise, no bias, nothing in the way."""


@cache
def panda():
    return robots.panda()


def posture(position, quat=DOWN):
    """Find joint positions for a tool pose, (7,), rad."""
    return InverseKinematics(panda()).solve(Pose(np.array(position, dtype=float), np.array(quat)), panda().home)


def worlds_at(position, config=CALM, preset="safe", n=1, seed=0, quat=DOWN, backend=None):
    """Make N worlds whose arms rest with the tool at a place, held there."""
    worlds = Worlds(panda(), config, presets.by_name(preset), n, seed, backend=backend)
    q = posture(position, quat)
    for i in range(n):
        worlds.reset(i, q)
    return worlds


def aim(worlds, position, i=0, stiffness=150.0, follow=True, quat=DOWN):
    """Set the target of world i; `follow`: the null-space posture goes there too."""
    target = worlds.controllers[i]["target"]
    target["position"], target["quat"] = position, quat
    target["K_task"], target["D_task"] = stiffness, 2.0 * np.sqrt(stiffness)
    if follow:
        target["q_posture"] = posture(position, quat)


def run(worlds, ticks):
    """Run this many ticks and return every tick's record, (n, ticks)."""
    pieces = []
    while ticks > 0:
        count = min(ticks, MAX_TICKS)
        trace = np.zeros((worlds.n, count), dtype=trace_dtype(7))
        worlds.run(count, trace)
        pieces.append(trace)
        ticks -= count
    return np.concatenate(pieces, axis=1)


FOREARM_REST = (0.14, -0.13, 0.55)
"""A place that the forearm passes when the tool goes to the right along the plate."""


def contact_wrench(model, data, geom, point):
    """Sum the simulator's contacts on one geom by the public API: wrench on it about a point, world axes, (6,)."""
    wrench, force = np.zeros(6), np.zeros(6)
    for i, contact in enumerate(data.contact[: data.ncon]):
        pair = (contact.geom1, contact.geom2)
        if model.geom(geom).id not in pair:
            continue
        mujoco.mj_contactForce(model, data, i, force)
        sign = 1.0 if pair[1] == model.geom(geom).id else -1.0  # the force acts on the second geom
        F, T = (sign * contact.frame.reshape(3, 3).T @ part for part in (force[:3], force[3:]))
        wrench[:3] += F
        wrench[3:] += T + np.cross(contact.pos - point, F)
    return wrench


def contact_torque(model, data, geom):
    """Joint torque on the arm of all its contacts with one geom, Σ Jᵀ F by the public API, (7,)."""
    tau, force = np.zeros(model.nv), np.zeros(6)
    for i, contact in enumerate(data.contact[: data.ncon]):
        pair = (contact.geom1, contact.geom2)
        if model.geom(geom).id not in pair:
            continue
        mujoco.mj_contactForce(model, data, i, force)
        arm_first = pair[1] == model.geom(geom).id
        body = model.geom_bodyid[pair[0] if arm_first else pair[1]]
        J, J_turn = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, J, J_turn, contact.pos, body)
        sign, frame = -1.0 if arm_first else 1.0, contact.frame.reshape(3, 3)
        tau += sign * (J.T @ frame.T @ force[:3] + J_turn.T @ frame.T @ force[3:])
    return tau[:7]
