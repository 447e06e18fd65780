"""Parts of a MuJoCo scene that is still to be compiled: a site at a flange, a motor, what is taken off."""

import os
from typing import Any, NamedTuple

import mujoco
import numpy as np

from contactsafe.core.errors import InvalidInputError, shown
from contactsafe.robot.names import listed, refuse_part

_LIMITED, _FREE = int(mujoco.mjtLimited.mjLIMITED_TRUE), int(mujoco.mjtLimited.mjLIMITED_FALSE)


class Flange(NamedTuple):
    """An end-effector point in a model that has no site there.

    Attributes:
        body: that carries it.
        position: in that body's frame, m.
        quat: of the tool's axes in that body's frame, w x y z.
        name: of the site that is made.
    """

    body: str
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quat: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    name: str = "flange"


def read_spec(path: str | os.PathLike) -> mujoco.MjSpec:
    """Read an MJCF file as a scene to be edited.

    Raises:
        InvalidInputError: MuJoCo cannot.
    """
    try:
        return mujoco.MjSpec.from_file(os.fspath(path))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InvalidInputError(f"MuJoCo cannot read '{os.fspath(path)}': {reason}; mend the file") from None


def compiled_spec(spec: mujoco.MjSpec, what: str) -> mujoco.MjModel:
    """Compile a scene.

    Raises:
        InvalidInputError: MuJoCo cannot.
    """
    try:
        return spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InvalidInputError(f"MuJoCo cannot read {what}: {reason}; mend the file") from None


def add_flange(spec: mujoco.MjSpec, site: str | Flange | None) -> str | None:
    """Return a site's name, made first where a `Flange` is given.

    Raises:
        InvalidInputError: there is no such body.
    """
    if not isinstance(site, Flange):
        return site
    body = spec.body(site.body)
    if body is None:
        if spec.site(site.body) is not None:
            raise InvalidInputError(f"{shown(site.body)} is a site, no body; give its name itself, without Flange")
        what = f"body {shown(site.body)} of the flange is not in the model"
        refuse_part(len(spec.bodies), what)
        raise InvalidInputError(f"{what}; give one of: {listed(one.name for one in spec.bodies[1:] if one.name)}")
    taken = {
        one.name for one in spec.sites if one.parent.name != site.body or not np.array_equal(one.pos, site.position)
    }
    if site.name not in taken and spec.site(site.name) is not None:
        return site.name
    name = next(name for name in (site.name, *(f"{site.name}{i}" for i in range(2, 100))) if name not in taken)
    body.add_site(name=name, pos=site.position, quat=site.quat)
    return name


def name_all(spec: mujoco.MjSpec) -> None:
    """Give parts a name where they have none: what is edited is found by its name."""
    named = {"joint": spec.joints, "body": spec.bodies[1:], "actuator": spec.actuators, "equality": spec.equalities}
    for kind, things in named.items():
        taken = {thing.name for thing in things}
        free = (f"{kind}{i}" for i in range(10**6) if f"{kind}{i}" not in taken)
        for thing in things:
            if not thing.name:
                thing.name = next(free)


def become_motor(actuator: Any, force: float) -> None:
    """Make an actuator of an `MjSpec` a motor, force in both directions at its control's unit; inf for no limit."""
    actuator.gaintype, actuator.gainprm = mujoco.mjtGain.mjGAIN_FIXED, [1.0, *9 * (0.0,)]
    actuator.biastype, actuator.biasprm = mujoco.mjtBias.mjBIAS_NONE, np.zeros(10)
    actuator.dyntype, actuator.dynprm = mujoco.mjtDyn.mjDYN_NONE, [1.0, *9 * (0.0,)]
    actuator.actdim, actuator.actlimited, actuator.actrange = -1, _FREE, (0.0, 0.0)
    actuator.inheritrange, actuator.plugin.active = 0.0, False
    if hasattr(actuator, "set_to_motor"):
        actuator.set_to_motor()  # newer versions have more of a servo to forget
    limited = bool(np.isfinite(force))
    actuator.ctrllimited = actuator.forcelimited = _LIMITED if limited else _FREE
    actuator.ctrlrange = actuator.forcerange = (-force, force) if limited else (0.0, 0.0)


def remove(spec: mujoco.MjSpec, thing: Any) -> None:
    """Take a part off a scene; before MuJoCo 3.5 parts delete themselves."""
    if hasattr(thing, "delete"):
        thing.delete()
    else:
        spec.delete(thing)


def linear(like: float | np.ndarray, value: float) -> float | list[float]:
    """Return a linear coefficient as an `MjSpec` has it: newer versions have those of higher orders behind it."""
    return value if np.ndim(like) == 0 else [value, *(np.size(like) - 1) * (0.0,)]
