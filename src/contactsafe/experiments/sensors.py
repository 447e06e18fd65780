"""Sensors of the arms in experiments, by name."""

from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.config import SENSORS

USUAL = "encoders"
"""Where nobody says which."""


def require_sensors(name: str) -> str:
    """Return the name of sensors as it was given.

    Raises:
        InvalidInputError: none of `SENSORS` has it.
    """
    if name not in SENSORS:
        raise InvalidInputError(f"sensors = {name!r}; choose from {', '.join(SENSORS)}")
    return name


def sensors_words(name: str) -> list[str]:
    """Return the words of the command line that ask for sensors, none where they are the usual ones."""
    return [] if name == USUAL else ["--sensors", name]
