"""What works otherwise than the user of an arm might think: where it starts, what acts on it, what it cannot do."""

import mujoco
import numpy as np

from contactsafe.robot.findings import Findings
from contactsafe.robot.names import JOINT, label, listed, several
from contactsafe.robot.user_chain import joints_above
from contactsafe.robot.user_home import least_reach, touching

_MARGIN_RAD, _MARGIN_OF_RANGE = 0.2, 0.25
"""Distance from the end of a range at which the stops of `presets.safe` begin, and at most this part of the range."""

_SINGULAR = 0.02
"""Least singular value of a Jacobian, m: so far the tool moves at least for a radian of all joints."""


def note_home(
    model: mujoco.MjModel, data: mujoco.MjData, chain: list[int], home: np.ndarray, findings: Findings
) -> None:
    """Tell of a home beside the end of a joint's range, or where the arm touches something.

    Args:
        model, data: of the scene; the arm is moved home.
        chain: the arm's joints.
        home: (n,), rad.
        findings: told of both.
    """
    for joint, angle in zip(chain, home, strict=True):
        low, high = model.jnt_range[joint]
        margin = min(_MARGIN_RAD, _MARGIN_OF_RANGE * (high - low))
        if model.jnt_limited[joint] and min(angle - low, high - angle) < margin:
            findings.note(
                f"home = {angle:.3g} rad of joint {label(model, JOINT, joint)} is within {margin:.2g} rad of an end of "
                f"its range [{low:.3g}, {high:.3g}], where joint stops push back; give home=[...] further inside"
            )
    data.qpos[model.jnt_qposadr[chain]] = home
    pairs = touching(model, data, chain)
    if pairs:
        findings.note(
            f"at home the arm touches something: {listed(pairs)}; that is felt as a contact, so leave out the pair "
            "(<contact><exclude .../></contact>), or give another home=[...]"
        )


def note_unserved(
    model: mujoco.MjModel, chain: list[int], nominal: mujoco.MjModel, home: np.ndarray, findings: Findings
) -> None:
    """Tell what the controller's model of the arm leaves out, and what such an arm cannot do.

    Args:
        model: of the scene.
        chain: the arm's joints.
        nominal: model of the arm alone.
        home: (n,), rad.
        findings: told of it.
    """
    if len(chain) >= 6 and _is_stretched(nominal, home):
        findings.note(
            "home is a singular posture, as of an arm stretched out: from there the tool cannot be moved in some "
            "direction, and poses beside it may have no posture; give home=[...]"
        )
    if len(chain) < 6:
        findings.note(
            f"{len(chain)} joints cannot serve all six coordinates of a pose: the tool goes to the position of a "
            "target, and takes the orientation nearest to the one asked for"
        )
    standing = [joint for joint in joints_above(model, model.jnt_bodyid[chain[0]]) if joint not in chain]
    free = [joint for joint in standing if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE]
    if free:
        findings.note(
            f"{several(model, JOINT, free, 'lets', 'let')} the base move, which is taken to stand still; bolt it down, "
            "or tell set_base how it moves, or what moves it is felt as a contact"
        )
    sprung = [joint for joint in chain if model.jnt_stiffness[joint] != 0.0]
    if sprung:
        findings.note(f"{several(model, JOINT, sprung)} a spring (stiffness), which is felt as a contact; set it to 0")


def _is_stretched(nominal: mujoco.MjModel, home: np.ndarray) -> bool:
    """Tell whether the tool cannot be moved in some direction."""
    data = mujoco.MjData(nominal)
    data.qpos[:] = home
    mujoco.mj_fwdPosition(nominal, data)
    return least_reach(nominal, data) < _SINGULAR
