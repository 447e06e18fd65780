"""What identification looks for, as columns of a least-squares problem, and what is known of it beforehand.

Torque that does not reach the links, or that a sensor shows beside what does, is of one form for each joint:
coulomb · step(q̇) + viscous · q̇ + bias, with the step of `contactsafe.logs.impulses.friction_step`, and of commands
the arm's published step besides. Priors are wide where a command is logged, and centred on the arm's published
friction; behind the gears there is little of it.
"""

from dataclasses import dataclass

import numpy as np

from contactsafe.logs.impulses import Impulses
from contactsafe.logs.least_squares import Problem
from contactsafe.robot.arm import Arm
from contactsafe.robot.friction import DRY_STEEP
from contactsafe.robot.regressor import PARAMETERS

_STEEPER, _SMOOTHER = (120.0, 400.0), (5.0, 12.0)
"""Steps of dry friction that are tried beside `DRY_STEEP`, s/rad; smoother ones where no friction is published."""

_COMMANDED = {"bias": 0.05, "viscous": 0.05, "coulomb": 0.1}
_MEASURED = {"bias": 0.004, "viscous": 0.001, "coulomb": 0.01}
"""Standard deviations beforehand as fractions of the torque limit; viscous at 1 rad/s. A torque sensor's bias is small
beside its hysteresis, which looks like friction."""

_LEAST_MOVING = 0.2
"""Fraction of windows in which a joint moves, below which it moves so little that all of them count."""

_ROTOR = 0.3
"""Of a rotor's inertia, as a fraction of the largest that the links have about that joint, plus all of the nominal."""

_LOAD_KG = 0.06
"""Of the payload's mass, kg per N m of the strongest joint: 5 kg for a Panda."""

_LOAD_AT_M = 0.2
"""How far from the last link's frame a load usually is."""


@dataclass(frozen=True)
class Unknowns:
    """Which unknowns a problem has, each of the joints' one after the other.

    Attributes:
        n: number of joints.
        behind_gears: whether the torque was measured behind the gears: then no rotor is among them.
        smooth: whether friction of the published form is.
        load: whether a payload is.
    """

    n: int
    behind_gears: bool
    smooth: bool
    load: bool

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of what each joint has."""
        smooth = ("smooth",) if self.smooth else ()
        return ("bias", "viscous", "coulomb", *smooth, *(() if self.behind_gears else ("rotor",)))

    def of(self, name: str) -> slice:
        """Return where something stands: one of `joints`, or 'load'."""
        first = self.n * (len(self.joints) if name == "load" else self.joints.index(name))
        return slice(first, first + (PARAMETERS if name == "load" else self.n))


def unknowns_of(arm: Arm, behind_gears: bool, load: bool) -> Unknowns:
    """Return what an arm's log is to show."""
    return Unknowns(arm.n, behind_gears, not behind_gears and bool((arm.friction[:, 0] > 0.0).any()), load)


def shapes_of(arm: Arm, behind_gears: bool) -> tuple[np.ndarray, ...]:
    """Return shapes of friction, (n, 2) each: the published one, then those of dry friction, the usual one first."""
    more = () if behind_gears else _STEEPER if (arm.friction[:, 0] > 0.0).any() else (*_STEEPER, *_SMOOTHER)
    return arm.friction[:, 1:], *(np.tile((steep, 0.0), (arm.n, 1)) for steep in (DRY_STEEP, *more))


def problem_of(arm: Arm, unknowns: Unknowns, impulses: Impulses, shape: np.ndarray) -> Problem:
    """Return the problem for one choice of friction shapes.

    Args:
        arm: whose published numbers are the prior's mean.
        unknowns: which.
        impulses: N windows.
        shape: which of the shapes the dry friction of each joint has, (n,).
    """
    n, step = unknowns.n, np.stack(impulses.steps)
    chosen = step[shape, :, np.arange(n)].T
    signals = {"bias": np.ones_like(chosen), "viscous": impulses.speed, "coulomb": chosen}
    signals |= {"smooth": step[0], "rotor": impulses.acceleration}
    columns = [signals[name][:, :, None] * np.eye(n) for name in unknowns.joints]
    spreads = _MEASURED if unknowns.behind_gears else _COMMANDED
    mean, spread = [], []
    for name in unknowns.joints:
        mean.append(_published(arm, name, unknowns.behind_gears))
        of_their_own = {"rotor": _rotor_spread, "smooth": _smooth_spread}
        spread.append(of_their_own[name](arm) if name in of_their_own else spreads[name] * arm.tau_max)
    if unknowns.load:
        columns.append(impulses.load)
        mean.append(np.zeros(PARAMETERS))
        spread.append(_load_spread(arm))
    return Problem(
        np.concatenate(columns, axis=2),
        impulses.driving,
        np.concatenate(mean),
        np.concatenate(spread),
        _counting(impulses.moving, unknowns.behind_gears),
    )


def _counting(moving: np.ndarray, behind_gears: bool) -> np.ndarray:
    """Return which windows of a joint count: where commands are logged, those in which it does not stick."""
    if behind_gears:
        return np.ones_like(moving)
    return moving | (moving.mean(axis=0) < _LEAST_MOVING)


def _published(arm: Arm, name: str, behind_gears: bool) -> np.ndarray:
    if behind_gears or name == "bias":
        return np.zeros(arm.n)  # a constant that is known already is found anew
    published = {"viscous": arm.drag[:, 0], "coulomb": arm.drag[:, 2], "smooth": 0.5 * arm.friction[:, 0]}
    return np.array(arm.model.dof_armature if name == "rotor" else published[name])


def _smooth_spread(arm: Arm) -> np.ndarray:
    return np.maximum(0.5 * arm.friction[:, 0], 1e-3 * arm.tau_max)


def _rotor_spread(arm: Arm) -> np.ndarray:
    inertia = np.diag(arm.dynamics(arm.home, np.zeros(arm.n))["M"])
    return np.array(arm.model.dof_armature + _ROTOR * inertia)


def _load_spread(arm: Arm) -> np.ndarray:
    kg = _LOAD_KG * float(arm.tau_max.max())
    return kg * np.repeat([1.0, _LOAD_AT_M, _LOAD_AT_M**2], [1, 3, 6])
