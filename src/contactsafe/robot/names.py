"""Things in a MuJoCo model by their names, and their names in messages."""

from collections.abc import Iterable

import mujoco

from contactsafe.core.errors import InvalidInputError

JOINT, SITE, ACTUATOR = mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtObj.mjOBJ_ACTUATOR
SENSOR, BODY = mujoco.mjtObj.mjOBJ_SENSOR, mujoco.mjtObj.mjOBJ_BODY
_LISTED = 12  # names that a message lists


def find(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str | None, otherwise: str = "") -> int:
    """Return the number of a named thing.

    Args:
        model, kind, name: as they say; None for a name that was not given.
        otherwise: a remedy beside the names that there are.

    Raises:
        InvalidInputError: there is none of that name, or none was named.
    """
    found = -1 if name is None else mujoco.mj_name2id(model, kind, str(name))
    if found < 0:
        word = kind.name.removeprefix("mjOBJ_").lower()
        count = {JOINT: model.njnt, SITE: model.nsite, ACTUATOR: model.actuator_trntype.size, SENSOR: model.nsensor}[
            kind
        ]
        names = [mujoco.mj_id2name(model, kind, i) for i in range(count)]
        what = f"{word} = None" if name is None else f"{word} '{name}' is not in the model"
        refuse_part(model.nbody, what)
        raise InvalidInputError(f"{what}; give one of: {listed(filter(None, names))}{otherwise}")
    return found


def refuse_part(bodies: int, what: str) -> None:
    """Refuse a model that holds the world alone: MuJoCo reads so what another file is to include.

    Raises:
        InvalidInputError: it does.
    """
    if bodies == 1:
        raise InvalidInputError(f"{what}, which has no bodies; if it is a part, give the file that includes it")


def or_flange(model: mujoco.MjModel) -> str:
    """Return the other remedy where a site is missing and one can be made, if the bodies have names."""
    bodies = [name for i in range(1, model.nbody) if (name := mujoco.mj_id2name(model, BODY, i))]
    return f"; or robots.Flange(BODY) to make one, on one of: {listed(bodies)}" if bodies else ""


def label(model: mujoco.MjModel, kind: mujoco.mjtObj, number: int) -> str:
    """Name a thing for a message: by its name, or by its number where it has none."""
    name = mujoco.mj_id2name(model, kind, number)
    return f"'{name}'" if name else f"{number} (without a name)"


def several(
    model: mujoco.MjModel, kind: mujoco.mjtObj, numbers: list[int], has: str = "has", have: str = "have"
) -> str:
    """Begin a sentence on one thing or several: "joint 'a' has", "joints 'a', 'b' have"."""
    word = kind.name.removeprefix("mjOBJ_").lower()
    names = listed(label(model, kind, number) for number in numbers)
    return f"{word} {names} {has}" if len(numbers) == 1 else f"{word}s {names} {have}"


def numbered(values: Iterable[float]) -> str:
    """Write numbers for a message."""
    return ", ".join(f"{value:.4g}" for value in values)


def listed(names: Iterable[object]) -> str:
    """Write names for a message, the first dozen of them."""
    words = [str(name) for name in names]
    more = f" and {len(words) - _LISTED} more" if len(words) > _LISTED else ""
    return ", ".join(words[:_LISTED]) + more or "none"
