"""Which joints of a user's model are the arm's, and what must not act on them beside its motors."""

from collections.abc import Sequence

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.binding import actuator_of, actuators_of
from contactsafe.robot.bodies import link_of
from contactsafe.robot.findings import Findings
from contactsafe.robot.names import JOINT, SITE, find, label, listed, several

_BODY, _EQUALITY, _HINGE = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_EQUALITY, mujoco.mjtJoint.mjJNT_HINGE


def choose_chain(
    model: mujoco.MjModel, site_id: int, names: Sequence[str] | None, findings: Findings, many: bool = False
) -> list[int]:
    """Choose the arm's joints among those that move a site, from base to tip.

    Args:
        model: of the scene.
        site_id: end-effector point.
        names: of the joints; None for all that move the site.
        findings: told of joints that cannot be the arm's; they are left out.
        many: whether a joint may have several actuators, or all of them none: they get a motor each.

    Raises:
        InvalidInputError: no joint is left to be checked further.
    """
    moving = joints_above(model, model.site_bodyid[site_id])
    site, rest = label(model, SITE, site_id), listed(label(model, JOINT, joint) for joint in moving)
    chosen = moving if names is None else _named(model, names, findings)
    if not moving or not chosen:
        findings.problem(f"no joints for site {site}; give it to a body of the arm; joints that move it: {rest}")
        findings.raise_problems()
    strangers = [joint for joint in chosen if joint not in moving]
    if strangers:
        move = several(model, JOINT, strangers, "does", "do")
        findings.problem(f"{move} not move site {site}; joints that do, base to tip: {rest}")
    chosen = [joint for joint in chosen if joint in moving]
    if chosen != [joint for joint in moving if joint in chosen]:
        findings.problem(f"joints = {list(names or ())} are not in order; from base to tip they stand so: {rest}")
        findings.raise_problems()
    return _suitable(model, chosen, names is None, findings, many)


def _named(model: mujoco.MjModel, names: Sequence[str], findings: Findings) -> list[int]:
    if isinstance(names, str):
        raise InvalidInputError(f"joints = {names!r} is one name; give a list of names, from base to tip")
    found = []
    for name in names:
        with findings.noting():
            found.append(find(model, JOINT, name))
    return found


def _motors_for(bare: int, hinges: int) -> str:
    """Return the remedy where some hinges have no actuator."""
    if bare == hinges:
        return 'give actuators="torque" for motors of their own'
    it = "it" if bare == 1 else "them"
    return f"give joints=[...] with {it}, or without {it}, to lock {it}"


def _suitable(model: mujoco.MjModel, chosen: list[int], by_itself: bool, findings: Findings, many: bool) -> list[int]:
    """Return those of the joints that are hinges, and tell of the others; of all, where they are to have actuators."""
    hinges = [joint for joint in chosen if model.jnt_type[joint] == _HINGE]
    bare = [joint for joint in hinges if by_itself and not actuators_of(model, joint)]
    if many and len(bare) == len(hinges):  # driven otherwise, by a mocap body or by nothing: all are to get motors
        bare = []
    fit = [str(mujoco.mj_id2name(model, JOINT, joint)) for joint in hinges if joint not in bare]
    those = f"; those that fit are joints={fit}" if 2 <= len(fit) < len(chosen) else ""
    for joint in (joint for joint in chosen if joint not in hinges):
        word = mujoco.mjtJoint(model.jnt_type[joint]).name.removeprefix("mjJNT_").lower()
        one = f"joint {label(model, JOINT, joint)} is of type {word}; the arm's are hinges"
        findings.problem(f"{one}: give joints=[...] without it, to lock it{those}")
    if bare:
        remedy = _motors_for(len(bare), len(hinges))
        findings.problem(f"{several(model, JOINT, bare)} no actuator; {remedy}{those}")
    for joint in hinges if not many else []:
        with findings.noting():
            actuator_of(model, joint)
    driven = [joint for joint in hinges if joint not in bare]
    if len(driven) < 2:
        findings.raise_problems()
        raise InvalidInputError(f"{len(driven)} hinge moves the site; an arm has two at least: name another site")
    return driven


def joints_above(model: mujoco.MjModel, body: int) -> list[int]:
    """Find all joints between the world and a body, from the world on."""
    joints: list[int] = []
    while body != 0:
        first = model.body_jntadr[body]
        joints[:0] = range(first, first + model.body_jntnum[body])
        body = model.body_parentid[body]
    return joints


def refuse_weightless(model: mujoco.MjModel, chain: list[int], findings: Findings) -> None:
    """Refuse bodies of the arm that carry their own weight: the controller's torque does."""
    floating = np.flatnonzero((link_of(model, chain) > 0) & (model.body_gravcomp != 0.0))
    if floating.size:
        others = f" and {floating.size - 1} more" if floating.size > 1 else ""
        findings.problem(
            f"body {label(model, _BODY, floating[0])}{others} has gravcomp = {model.body_gravcomp[floating[0]]:g}; "
            "the controller's torque includes gravity, so it must be 0 on every body of the arm"
        )


def refuse_tied(model: mujoco.MjModel, chain: list[int], findings: Findings, may_be_led: bool = False) -> None:
    """Refuse equality constraints on the arm: a dynamic model of the chain alone would not know them."""
    for i in (i for i in ties(model, chain) if not (may_be_led and is_led(model, i))):
        findings.problem(
            f"equality constraint {label(model, _EQUALITY, i)} ties the arm; an arm is a free chain of hinges, "
            "remove it"
        )


def ties(model: mujoco.MjModel, chain: list[int]) -> list[int]:
    """Return the equality constraints in force that tie a link of the arm."""
    carried = {int(model.jnt_bodyid[joint]) for joint in chain}
    active = np.flatnonzero(model.eq_active0).tolist()
    return [i for i in active if not carried.isdisjoint(_tied_bodies(model, i))]


def is_led(model: mujoco.MjModel, i: int) -> bool:
    """Tell whether an equality constraint leads a body after a mocap body: which drives an arm otherwise."""
    return any(model.body_mocapid[body] >= 0 for body in _ends(model, i))


def _tied_bodies(model: mujoco.MjModel, i: int) -> list[int]:
    """Return the moving bodies that an equality constraint ties: by their joints, by themselves or by their sites."""
    if model.eq_type[i] == int(mujoco.mjtEq.mjEQ_JOINT):
        return [int(model.jnt_bodyid[end]) for end in (model.eq_obj1id[i], model.eq_obj2id[i]) if end >= 0]
    return [int(model.body_weldid[end]) for end in _ends(model, i)]


def _ends(model: mujoco.MjModel, i: int) -> list[int]:
    """Return the bodies at the ends of an equality constraint between bodies or their sites."""
    ends = [int(end) for end in (model.eq_obj1id[i], model.eq_obj2id[i]) if end >= 0]
    if model.eq_objtype[i] == int(SITE):
        return [int(model.site_bodyid[end]) for end in ends]
    return ends if model.eq_objtype[i] == int(_BODY) else []
