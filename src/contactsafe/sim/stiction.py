"""Dry friction of joints: bristles that bend before they slide, Dahl's model; compiled."""

from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled

_BEND_RAD = 5e-4
"""By which a joint at rest gives before it slides."""


@compiled
def add_stiction(errors: Record, qd: Vector, drag: Vector, dt: float) -> None:
    """Add dry friction to what drags on the joints: F z with ż = (q̇ − |q̇| z) / z_max (Dahl 1968).

    Args:
        errors: `errors_dtype` record; its bristles advance.
        qd: (n,), rad/s.
        drag: (n,), N m; added to.
        dt: s.
    """
    for i in range(qd.shape[0]):
        if errors.stiction[i] > 0.0:
            z = errors.bristle[i] + qd[i] * dt / _BEND_RAD
            z -= abs(qd[i]) * dt / _BEND_RAD * errors.bristle[i]
            errors.bristle[i] = min(max(z, -1.0), 1.0)
            drag[i] += errors.stiction[i] * errors.bristle[i]
