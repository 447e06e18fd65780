"""How a trial of a battery is run again: by a command, or by Python where the arm or a controller is one's own."""

import shlex
from collections.abc import Mapping, Sequence

import numpy as np

from contactsafe.control import presets
from contactsafe.control.config import ControllerConfig
from contactsafe.robot.arm import Arm
from contactsafe.robot.soundness import as_numbers, model_numbers


def run_again(
    function: str,
    experiment: Sequence[str],
    controllers: Mapping[str, ControllerConfig],
    arms: tuple[Arm, Arm],
    arm_words: Sequence[str] | None = None,
) -> str:
    """Return what runs one seed again, with {seed} in its place.

    Args:
        function: of Python.
        experiment: words of the command line that name experiment and options.
        controllers: configurations by name.
        arms: that was used, and that the command takes where nobody names one.
        arm_words: words of the command line that name the arm which was used; None where it was given by Python.
    """
    usual = same_arm(*arms)
    shipped = all(name in presets.PRESETS and presets.by_name(name) == law for name, law in controllers.items())
    if not shipped or not (usual or arm_words):
        return f"{function}(controllers, [{{seed}}]{'' if usual else ', arm=arm'})"
    words = shlex.join(["contactsafe", "experiment", *experiment, *(() if usual else arm_words or ())])
    words = words.replace("{", "{{").replace("}", "}}")
    return f"{words} --trials 1 --out trial-{{seed}} --seed {{seed}}"


def same_arm(one: Arm, other: Arm) -> bool:
    """Tell whether two arms are the same in all that a simulation of them goes by."""
    if (one.name, one.n, one.description, one.tool) != (other.name, other.n, other.description, other.tool):
        return False
    mine, others = ({**as_numbers(arm), **model_numbers(arm)} for arm in (one, other))
    return all(np.array_equal(value, others[name]) for name, value in mine.items())
