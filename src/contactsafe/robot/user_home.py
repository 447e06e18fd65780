"""Where a user's arm starts: its key frame, and whether it can stay there."""

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import finite_array, finite_range
from contactsafe.robot.binding import actuators_of
from contactsafe.robot.bodies import base_bodies, link_of
from contactsafe.robot.findings import Findings
from contactsafe.robot.names import BODY, JOINT, label, listed

_KEY = mujoco.mjtObj.mjOBJ_KEY

_TRIED, _INNER, _PARTS = 500, 0.15, (0.25, 0.5, 0.75, 1.0)
"""Postures that are tried, the part of a range at either end that they keep away from, and how far towards them."""

_UPRIGHT, _BELOW_M = 0.9, 0.1
"""Cosine from which on the first axis counts as upright, and how far below it a home may reach, m."""

_NOTHING_M = 1e-6
"""What the tool moves by rounding alone, m: an arm of parallel axes never moves it to all sides."""

_READY = 0.4
"""Part of the best readiness from which on a posture will do."""

HOME = "home"
"""The key frame that is taken where none is named."""


def _asked_for(names: list[str], asked: str) -> str:
    """Return the name that is asked for, or whose first letters are, if they are of only one."""
    if not names:
        what = f"home = {asked!r}, and the model has no key frames"
        raise InvalidInputError(f"{what}; give joint positions, or leave it out: one is chosen")
    found = [name for name in names if name == asked] or [one for one in names if asked and one.startswith(asked)]
    if len(found) != 1:
        known = listed(map(repr, names))
        raise InvalidInputError(f"home = {asked!r} is none of the key frames; give one of {known}")
    return found[0]


def key_frame(model: mujoco.MjModel, chain: list[int], asked: str | None, findings: Findings) -> int:
    """Find the key frame of an arm's home; −1 for none.

    Args:
        model: of the scene.
        chain: the arm's joints.
        asked: its name, or the first letters of only one; None for 'home', the only one, or the 'home' with the
            prefix that a joint has, as `attach` gives it.
        findings: told where none is taken though there are some.

    Raises:
        InvalidInputError: there is none of that name.
    """
    names = [mujoco.mj_id2name(model, _KEY, i) or "" for i in range(model.nkey)]
    if asked is not None:
        return names.index(_asked_for(names, asked))
    if HOME in names:
        return names.index(HOME)
    if len(names) == 1:
        return 0
    joint = mujoco.mj_id2name(model, JOINT, chain[0]) or ""
    prefixed = [name for name in names if name.endswith(HOME) and joint.startswith(name.removesuffix(HOME))]
    if len(prefixed) == 1:
        return names.index(prefixed[0])
    if names:
        findings.note(
            f"home is one that was chosen here, since no key frame is called '{HOME}'; of {listed(map(repr, names))} "
            "give home='...'"
        )
    return -1


def at_start(model: mujoco.MjModel, chain: list[int], key: int) -> tuple[mujoco.MjData, np.ndarray | None]:
    """Place all bodies with the arm's joints unturned and the others locked, as a key frame has them.

    Returns:
        Data so placed, and the arm's joints in the key frame, (n,), rad; None without one.
    """
    data = mujoco.MjData(model)
    address = model.jnt_qposadr[chain]
    if key >= 0:
        mujoco.mj_resetDataKeyframe(model, data, key)
    home = data.qpos[address].copy() if key >= 0 else None
    data.qpos[address] = model.qpos0[address]
    mujoco.mj_kinematics(model, data)
    return data, home


def checked_home(home: ArrayLike | None, q_min: np.ndarray, q_max: np.ndarray, findings: Findings) -> np.ndarray:
    """Return a home within the range, (n,), rad: the one given, or the middle of the range, see `usual_home`."""
    middle = np.mean(finite_range(q_min, q_max), axis=0)
    if home is None:
        return middle
    try:
        given = finite_array(home, q_min.shape, "home")
    except InvalidInputError as error:
        findings.problem(str(error))
        return middle
    outside = (given < q_min) | (given > q_max)
    if outside.any():
        i = int(np.argmax(outside))
        findings.problem(f"home[{i}] = {given[i]:g} rad is outside [{q_min[i]:g}, {q_max[i]:g}]; move it inside")
    return given


def usual_home(
    model: mujoco.MjModel,
    chain: list[int],
    nominal: mujoco.MjModel,
    joint_range: tuple[np.ndarray, np.ndarray],
    limits: np.ndarray,
) -> np.ndarray:
    """Choose a home where nobody gave one, (n,), rad: a posture from which the arm can work.

    It is the middle of the range where the tool can be moved to all sides there, the motors carry the arm, and nothing
    of it is beside its base or beyond; else the posture next to it, of many at random and those between, the same in
    every run.

    Args:
        model: of the scene.
        chain: the arm's joints.
        nominal: model of the arm alone.
        joint_range: lowest and highest positions, (n,) each, rad.
        limits: of torque, (n,), N m.
    """
    low, high = finite_range(*joint_range)
    middle, inner = 0.5 * (low + high), _INNER * (high - low)
    rng = np.random.default_rng(0)
    postures = np.vstack([middle, rng.uniform(low + inner, high - inner, (_TRIED, len(chain)))])
    data, readiness, away = mujoco.MjData(nominal), np.zeros(len(postures)), _away_from_base(model, chain[0])
    for i, q in enumerate(postures):
        readiness[i] = _readiness(nominal, data, q, limits, away)
    ready = _READY * readiness.max()
    if readiness[0] >= ready:
        return middle
    between = [middle + part * (q - middle) for q in postures[readiness >= ready] for part in _PARTS]
    distance = [float(np.linalg.norm((q - middle) / (high - low))) for q in between]
    scene = mujoco.MjData(model)
    for i in np.argsort(distance, kind="stable"):
        scene.qpos[model.jnt_qposadr[chain]] = between[i]
        if _readiness(nominal, data, between[i], limits, away) >= ready and not touching(model, scene, chain):
            return between[i]
    return middle


def _readiness(
    nominal: mujoco.MjModel, data: mujoco.MjData, q: np.ndarray, limits: np.ndarray, away: np.ndarray
) -> float:
    """Return how far the tool moves at least for a radian of all joints, m.

    0 where gravity takes half the torque, or where the arm may reach into what it is mounted on.
    """
    data.qpos[:], data.qvel[:] = q, 0.0
    mujoco.mj_fwdPosition(nominal, data)
    mujoco.mj_fwdVelocity(nominal, data)
    if (np.abs(data.qfrc_bias) > 0.5 * limits).any() or _reaches_into_base(data, away):
        return 0.0
    return least_reach(nominal, data)


def _away_from_base(model: mujoco.MjModel, first: int) -> np.ndarray:
    """Return the direction from what the arm is mounted on, table or ceiling, to the arm, (3,); 0 if it is not upright.

    It is that of the first joint's axis, to the side on which the joint lies of its base.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    axis, base = data.xaxis[first], data.xpos[model.body_parentid[model.jnt_bodyid[first]]]
    if abs(axis[2]) < _UPRIGHT:
        return np.zeros(3)
    height = float(axis @ (data.xanchor[first] - base))
    return axis * np.sign(height if abs(height) > _NOTHING_M else axis[2])


def _reaches_into_base(data: mujoco.MjData, away: np.ndarray) -> bool:
    """Tell whether a joint or the tool lies behind the first joint, in the direction of what the arm is mounted on."""
    heights = (np.vstack([data.xanchor, data.site_xpos[:1]]) - data.xanchor[0]) @ away
    return bool((heights < -_BELOW_M).any())


def least_reach(nominal: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return how far the tool moves at least for a radian of all joints, m; a turn moves what is half a metre away."""
    J = np.zeros((6, nominal.nv))
    mujoco.mj_jacSite(nominal, data, J[:3], J[3:], 0)
    J[3:] *= 0.5
    found = np.linalg.svd(J, compute_uv=False)
    return float(found[-1]) if found[-1] > _NOTHING_M else 0.0


def touching(model: mujoco.MjModel, data: mujoco.MjData, chain: list[int]) -> list[str]:
    """Return the pairs of bodies that touch, of which one is moved by the arm and the other is not alike."""
    mujoco.mj_fwdPosition(model, data)
    links, base = link_of(model, chain), base_bodies(model, chain)
    pairs = []
    for i in range(data.ncon):
        contact = data.contact[i]
        if min(contact.geom1, contact.geom2) < 0:  # a flexible body's
            continue
        first, second = sorted(int(model.geom_bodyid[geom]) for geom in (contact.geom1, contact.geom2))
        apart = links[first] != links[second] or base[first] or base[second]
        if contact.dist < 0.0 and apart and max(links[first], links[second]) > 0:
            pairs.append(f"{label(model, BODY, first)} on {label(model, BODY, second)}")
    return list(dict.fromkeys(pairs))


def check_held(
    model: mujoco.MjModel, chain: list[int], torques: tuple[np.ndarray, np.ndarray], meant: bool, findings: Findings
) -> None:
    """Tell of joints whose motors cannot carry the arm at home.

    Args:
        model: of the scene.
        chain: the arm's joints.
        torques: what holds the arm at home, and the limits, (n,), N m each.
        meant: whether somebody chose that home; the middle of the range is nobody's choice.
        findings: told of them: a problem, but of a home that nobody chose a note, unless limits are angles.
    """
    weak = [row for row in zip(chain, *torques, strict=True) if abs(row[1]) > row[2]]
    if not weak:
        return
    short = ", ".join(
        f"{abs(need):.3g} N m at joint {label(model, JOINT, i)} (limit {top:.3g})" for i, need, top in weak
    )
    angles = [joint for joint, _, _ in weak if _is_angle(model, joint)]
    remedy = "give the motors a forcerange in N m, or another home=[...]"
    if angles:
        remedy = (
            f"the ctrlrange of {listed(label(model, JOINT, joint) for joint in angles)} is that of angles, {remedy}"
        )
    text = f"gravity takes {short} at home, and the arm would fall; {remedy}"
    findings.problem(text) if meant or angles else findings.note(text)


def _is_angle(model: mujoco.MjModel, joint: int) -> bool:
    """Tell whether a motor on a joint has the joint's range for its range of control."""
    works = [one for one in actuators_of(model, joint) if model.actuator_ctrllimited[one]]
    return any(np.allclose(model.actuator_ctrlrange[one], model.jnt_range[joint], atol=0.05) for one in works)
