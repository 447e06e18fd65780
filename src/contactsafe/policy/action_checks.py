"""What an `ActionConfig` must not hold."""

import math
from typing import TYPE_CHECKING

from contactsafe.core.errors import InvalidInputError

if TYPE_CHECKING:
    from contactsafe.policy.action_config import ActionConfig


def check_steps(config: "ActionConfig") -> None:
    """Refuse steps that cannot be: those of x_d are divided by."""
    if not (len(config.translation) == 3 and all(0.0 < step < math.inf for step in config.translation)):
        raise InvalidInputError(f"action translation = {config.translation}; give three steps greater than 0 m")
    for name, count in (("rotation", 3), ("stiffness", 6), ("damping", 6)):
        steps = getattr(config, name)
        if not (len(steps) == count and all(0.0 <= step < math.inf for step in steps)):
            raise InvalidInputError(f"action {name} = {steps}; give {count} steps of 0 or more")


def check_bounds(config: "ActionConfig") -> None:
    """Refuse ranges and bounds that cannot be."""
    for name in ("stiffness", "damping"):
        low, high = getattr(config, f"{name}_low"), getattr(config, f"{name}_high")
        pairs = zip(low, high, strict=False)
        if not (len(low) == len(high) == 6 and all(0.0 < least <= most < math.inf for least, most in pairs)):
            raise InvalidInputError(f"action {name} = {low} to {high}; give six each, with 0 < low ≤ high")
    if not (len(config.stiffness_start) == 6 and all(0.0 < start < math.inf for start in config.stiffness_start)):
        raise InvalidInputError(f"action stiffness_start = {config.stiffness_start}; give six greater than 0 1/s²")
    if not (config.offset_max > 0.0 and config.offset_max_z > 0.0):
        found = f"offset_max = {config.offset_max}, offset_max_z = {config.offset_max_z}"
        raise InvalidInputError(f"action {found}; give more than 0 m, or inf for no bound")
    spans = (config.reach, config.tilt, config.press + config.height)
    if not all(0.0 <= span < math.inf for span in spans):
        found = f"reach = {config.reach}, tilt = {config.tilt}, press = {config.press}, height = {config.height}"
        raise InvalidInputError(f"action {found}; give a reach, a tilt and a press + height of 0 or more")
