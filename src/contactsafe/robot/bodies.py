"""Which bodies of a scene are part of an arm's base, of its links and of what its last link carries."""

import functools
import operator

import mujoco
import numpy as np

from contactsafe.robot.description import Inertia

_ENDLESS = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)


def link_of(model: mujoco.MjModel, chain: list[int]) -> np.ndarray:
    """Return the link that each body is part of, (nbody,): 1 … n, 0 for what the arm does not move.

    Args:
        model: of the scene.
        chain: the arm's joints, from base to tip.
    """
    moved_by = {int(model.jnt_bodyid[joint]): link for link, joint in enumerate(chain, start=1)}
    links = np.zeros(model.nbody, dtype=int)
    for body in range(1, model.nbody):
        links[body] = moved_by.get(body, links[model.body_parentid[body]])
    return links


def shown_by(model: mujoco.MjModel, chain: list[int]) -> np.ndarray:
    """Return whose surface each body's surface is, (nbody,): its link's, but what the last link carries is tool, 0.

    Only where the last link's own body shows nothing, what it carries is taken for the link.
    """
    links, last = link_of(model, chain), model.jnt_bodyid[chain[-1]]
    if model.body_geomnum[last] > 0:
        links[links == len(chain)] = 0
        links[last] = len(chain)
    return links


def base_bodies(model: mujoco.MjModel, chain: list[int]) -> np.ndarray:
    """Return which bodies are the base, (nbody,) bool: all between the world and link 1, and what is fixed to them."""
    base, body = np.zeros(model.nbody, dtype=bool), model.body_parentid[model.jnt_bodyid[chain[0]]]
    while body != 0:
        base[body] = True
        body = model.body_parentid[body]
    links = link_of(model, chain)
    for body in range(1, model.nbody):
        base[body] |= base[model.body_parentid[body]] and model.body_jntnum[body] == 0 and links[body] == 0
    return base


def shown_geoms(model: mujoco.MjModel, part: np.ndarray) -> np.ndarray:
    """Return the geoms that show some bodies, (k,): those that can collide, or where none can, all of them.

    Args:
        model: of the scene.
        part: which bodies, (nbody,) bool.
    """
    geoms = np.flatnonzero(part[model.geom_bodyid] & ~np.isin(model.geom_type, _ENDLESS))
    solid = geoms[(model.geom_contype[geoms] != 0) | (model.geom_conaffinity[geoms] != 0)]
    return solid if solid.size else geoms


def inertia_of(model: mujoco.MjModel, data: mujoco.MjData, part: np.ndarray, origin: np.ndarray) -> Inertia | None:
    """Return the inertia of bodies as they stand, in world axes and from an origin; None where they have no mass.

    Args:
        model: of the scene.
        data: of it, with all bodies in place.
        part: which bodies, (nbody,) bool.
        origin: (3,), m.
    """
    found = []
    for body in np.flatnonzero(part & (model.body_mass > 0.0)):
        axes = data.ximat[body].reshape(3, 3)
        tensor = axes @ np.diag(model.body_inertia[body]) @ axes.T
        found.append(Inertia.of(float(model.body_mass[body]), data.xipos[body] - origin, tensor))
    return functools.reduce(operator.add, found) if found else None
