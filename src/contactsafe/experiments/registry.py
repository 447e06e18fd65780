"""The experiments by name. A new one is a file that declares its `Entry`, and a line here."""

from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments import (
    adversarial,
    any_arm,
    clock,
    collisions,
    detection,
    disturbance,
    joint_safety,
    localisation,
    pushes,
    task_safety,
)
from contactsafe.experiments.config import Entry

PAPER = ("task-safety", "joint-safety", "disturbance")
"""The paper's own experiments, which the demo runs."""

ENTRIES: dict[str, Entry] = {
    entry.name: entry
    for entry in (
        task_safety.ENTRY,
        joint_safety.ENTRY,
        disturbance.ENTRY,
        collisions.ENTRY,
        detection.ENTRY,
        pushes.ENTRY,
        localisation.ENTRY,
        adversarial.ENTRY,
        clock.ENTRY,
        any_arm.ENTRY,
    )
}


def by_name(name: str) -> Entry:
    """Return the experiment of that name.

    Raises:
        InvalidInputError: no such experiment.
    """
    if name not in ENTRIES:
        raise InvalidInputError(f"experiment '{name}' is unknown; choose from {', '.join(ENTRIES)}")
    return ENTRIES[name]
