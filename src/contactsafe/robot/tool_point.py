"""The arm in a model that nobody described: its longest chain of hinges, and the body that carries the tool."""

from collections.abc import Iterator

import mujoco

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.missing_meshes import make_compilable
from contactsafe.robot.spec_parts import Flange, compiled_spec

_HINGE, _FREE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_FREE)

_FINGER, _OF_HAND = 2, 5
"""Hinges that a gripper's finger has at most, and one of a hand of three fingers or more."""


def find_tool(spec: mujoco.MjSpec) -> tuple[Flange, list[str]]:
    """Find the longest chain of hinges in a scene, up to the hand, and the hinges' names from base to tip.

    From the world on the body that the most hinges follow is taken, until only fingers are left. Of two arms alike it
    is the first. The tool point is the origin of the hand's body.

    Args:
        spec: of the scene; parts without a name get one, and meshes that are nowhere are left out.

    Raises:
        InvalidInputError: there is no chain of two hinges.
    """
    make_compilable(spec)
    model = compiled_spec(spec, "the MjSpec")
    body, hinges = 0, list[int]()
    while (follower := _followed(model, body, hinges)) is not None:
        body = follower
        for joint in _joints(model, body):
            if model.jnt_type[joint] == _HINGE:
                hinges.append(joint)
            else:
                hinges.clear()  # a slide or a free body carries the arm
    if len(hinges) < 2:
        raise InvalidInputError(
            f"the model has a chain of {len(hinges)} hinges; an arm has two at least: name its tool"
        )
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, joint) for joint in hinges]
    return Flange(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)), names


def _followed(model: mujoco.MjModel, body: int, hinges: list[int]) -> int | None:
    """Return the body to go on to; None where a hand is reached."""
    followers = [(_reach(model, child), -child) for child in _moving_children(model, body)]
    followers = [follower for follower in followers if follower[0] > 0]
    if not followers:
        return None
    longest, first = max(followers)
    alike = sum(reach >= longest - 1 for reach, _ in followers)
    if len(hinges) >= 2 and ((longest <= _FINGER and len(followers) > 1) or (longest <= _OF_HAND and alike > 2)):
        return None
    return -first


def _moving_children(model: mujoco.MjModel, body: int) -> Iterator[int]:
    """Yield the next bodies down the tree that have joints."""
    for child in range(1, model.nbody):
        if model.body_parentid[child] == body and child != body:
            if model.body_jntnum[child]:
                yield child
            else:
                yield from _moving_children(model, child)


def _reach(model: mujoco.MjModel, body: int) -> int:
    """Return the most hinges from a body on down one branch."""
    own = sum(model.jnt_type[joint] == _HINGE for joint in _joints(model, body))
    if any(model.jnt_type[joint] == _FREE for joint in _joints(model, body)):
        own = 0
    return own + max((_reach(model, child) for child in _moving_children(model, body)), default=0)


def _joints(model: mujoco.MjModel, body: int) -> range:
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))
