"""The description of an arm that was found in a scene: what worlds, pictures and other engines build it from.

Its frames lie at the joints with z along them, the base frame at the world's origin, and the tool's mount at the
site. Joints and masses are the scene's to rounding; the shape is capsules about the geoms.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from contactsafe.core.rotation import matrix_to_quat
from contactsafe.robot.bodies import base_bodies, inertia_of, link_of, shown_by, shown_geoms
from contactsafe.robot.description import ArmDescription, Capsule, Inertia, Joint, Link, Tip, Tool
from contactsafe.robot.enclosing import capsule_between, enclosing_capsule, geom_hull, placed, with_axis

NOTHING = 1e-12
"""Mass, kg, and moment of inertia, kg m², of what has none: MuJoCo takes no zero."""

_THIN = 1.0 - 1e-9  # of the sum of two moments of inertia that the third may be, or rounding exceeds the sum

_COVERED = 1e-3  # m; what is within the tip but for this is the tip


class Frame(NamedTuple):
    """Where a frame is in the scene: origin (3,), m, and rotation (3, 3)."""

    origin: np.ndarray
    rotation: np.ndarray

    def within(self, other: "Frame") -> "Frame":
        """Return this frame as seen from another."""
        return Frame(other.rotation.T @ (self.origin - other.origin), other.rotation.T @ self.rotation)


_WORLD = Frame(np.zeros(3), np.eye(3))


class Found(NamedTuple):
    """An arm in a scene.

    Attributes:
        model: of the scene.
        data: of it, with the arm's joints unturned and all else in place.
        chain: the arm's joints, from base to tip.
        site: end-effector point.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    chain: list[int]
    site: int


def describe(
    found: Found, name: str, joints: tuple[Joint, ...], torque_rate_max: float, home: np.ndarray
) -> ArmDescription:
    """Return the description of an arm in a scene; what its last link carries is left out, see `carried_tool`.

    Args:
        found: the arm.
        name: for messages and files.
        joints: limits, friction and rotors, from base to tip.
        torque_rate_max: N m/s, every joint.
        home: a posture well inside the limits, (n,), rad.
    """
    model, chain = found.model, found.chain
    frames, shown, moved = _frames(found), shown_by(model, chain), link_of(model, chain)
    parts = [moved == link for link in range(1, len(chain) + 1)]
    parts[-1] &= ~_carried(found)
    links, before = [], _WORLD
    for link, (frame, joint, part) in enumerate(zip(frames, joints, parts, strict=True), start=1):
        unturned = Frame(frame.origin, frame.rotation @ _about_z(-_zero(found, link)))
        position, quat = _pose(unturned.within(before))
        capsules = _capsules(found, shown == link, frame)
        links.append(Link(position, quat, _inertia(found, part, frame), joint, capsules))
        before = frame
    base = base_bodies(model, chain)
    position, quat = _pose(_mount(found).within(before))
    return ArmDescription(
        name=name,
        source=f"the arm that ends in site '{_site_name(found)}' of a MuJoCo scene",
        base=_inertia(found, base, _WORLD),
        base_capsules=_capsules(found, base, _WORLD),
        links=tuple(links),
        mount_position=position,
        mount_quat=quat,
        torque_rate_max=torque_rate_max,
        home=tuple(float(angle) for angle in home),
    )


def carried_tool(found: Found, tip: Tip | None) -> Tool:
    """Return what the last link carries, as a tool whose mount and TCP are the site.

    Args:
        found: the arm.
        tip: the part that works, its face on the site. What of the scene lies within it is left out, and what beside
            it reaches further than its upper face is moved back: nothing but the tip is to touch what the tip is for.
    """
    mount, carried = _mount(found), _carried(found)
    capsules = _capsules(found, carried, mount, tip)
    return Tool(_site_name(found), _inertia(found, carried, mount), (0.0, 0.0, 0.0), capsules, tip)


def _frames(found: Found) -> list[Frame]:
    """Return the links' frames at the joints, as turned as the joints are."""
    data, chain = found.data, found.chain
    return [Frame(data.xanchor[joint].copy(), with_axis(data.xaxis[joint])) for joint in chain]


def _mount(found: Found) -> Frame:
    return Frame(found.data.site_xpos[found.site].copy(), found.data.site_xmat[found.site].reshape(3, 3).copy())


def _site_name(found: Found) -> str:
    return str(mujoco.mj_id2name(found.model, mujoco.mjtObj.mjOBJ_SITE, found.site))


def _zero(found: Found, link: int) -> float:
    """Return what the joint of a link reads where the scene has it unturned, rad."""
    return float(found.model.qpos0[found.model.jnt_qposadr[found.chain[link - 1]]])


def _carried(found: Found) -> np.ndarray:
    """Return which bodies the last link carries, (nbody,) bool: those that it moves and that do not show it."""
    n = len(found.chain)
    carried = link_of(found.model, found.chain) == n
    return carried & (shown_by(found.model, found.chain) != n)


def _inertia(found: Found, part: np.ndarray, frame: Frame) -> Inertia:
    """Return the inertia of bodies in a frame, such as MuJoCo takes it."""
    total = inertia_of(found.model, found.data, part, frame.origin)
    if total is None:
        return Inertia(NOTHING, (0.0, 0.0, 0.0), (NOTHING, NOTHING, NOTHING, 0.0, 0.0, 0.0))
    R = frame.rotation
    moments, axes = np.linalg.eigh(R.T @ total.matrix() @ R)
    moments = np.maximum(moments, NOTHING)
    moments[2] = min(moments[2], _THIN * (moments[0] + moments[1]))
    return Inertia.of(total.mass, R.T @ np.array(total.com), axes @ np.diag(moments) @ axes.T)


def _capsules(found: Found, part: np.ndarray, frame: Frame, tip: Tip | None = None) -> tuple[Capsule, ...]:
    """Return capsules about the geoms of bodies, in a frame; behind the tip of a tool, where one is given."""
    model, data, R = found.model, found.data, frame.rotation
    capsules = []
    for geom in shown_geoms(model, part):
        position, rotation = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
        hull = placed(geom_hull(model, int(geom)), R.T @ (position - frame.origin), R.T @ rotation)
        if tip is None:
            capsules.append(enclosing_capsule(hull))
        elif not _is_covered(hull.points, hull.radius, tip):
            capsules.append(_moved_back(enclosing_capsule(hull), -2.0 * tip.half_size[2]))
    return tuple(capsules)


def _is_covered(points: np.ndarray, radius: float, tip: Tip) -> bool:
    half = np.array(tip.half_size)
    centre = np.array([0.0, 0.0, -half[2]])
    beyond = np.abs(points - centre) + radius - half
    return bool((beyond < _COVERED).all())


def _moved_back(capsule: Capsule, height: float) -> Capsule:
    """Return a capsule none of which is above a height along z, m."""
    ends = np.array([capsule.start, capsule.end])
    ends[:, 2] = np.minimum(ends[:, 2], height - capsule.radius)
    return capsule_between(ends[0], ends[1], capsule.radius)


def _pose(frame: Frame) -> tuple[tuple, tuple]:
    return tuple(frame.origin.tolist()), tuple(matrix_to_quat(np.ascontiguousarray(frame.rotation)).tolist())


def _about_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)])
