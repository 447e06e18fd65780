"""The fit of one log to one arm: friction shapes and payload chosen, what cannot be negative kept from it."""

from dataclasses import dataclass

import numpy as np

from contactsafe.logs.impulses import Impulses, impulses_of
from contactsafe.logs.least_squares import Problem, Solution, solve
from contactsafe.logs.smoothing import Signals
from contactsafe.logs.unknowns import Unknowns, problem_of, shapes_of, unknowns_of
from contactsafe.robot.arm import Arm
from contactsafe.robot.calibration import Losses
from contactsafe.robot.description import Inertia, point_tensor
from contactsafe.robot.friction import DRY_STEEP
from contactsafe.robot.regressor import PARAMETERS

_NOT_NEGATIVE = ("viscous", "coulomb", "smooth", "rotor")
_NOT_NEGATIVE_BEHIND_GEARS = ("viscous",)
"""There hysteresis of a sensor looks like dry friction of either sign; what grows with velocity is lost in bearings. A
real Panda's first half, free to show −0.016 N m s/rad, made the second half of joint 5 worse than its description."""

_PINNED = 1e-9
"""Of its spread, that is left to an unknown which would be negative."""

_CLEARLY = 0.98
"""By this factor a friction shape must lessen a joint's residual to replace the one before it."""

_CARRIES = 0.8
"""By this factor a payload must lessen the squares of what is held out, or there is none."""

_SIZE_M = 0.1
"""Radius of gyration of a load about its centre of mass, as far as nothing else is known."""


@dataclass(frozen=True)
class Fit:
    """What was found of a log.

    Attributes:
        unknowns: which.
        impulses: of the log.
        shapes: of dry friction, φ2 s/rad and φ3 rad/s, (n, 2).
        published: the arm's own, likewise.
        problem: with the priors that were in force.
        solution: of all windows.
        nominal: what the arm's own description leaves of every window, (N, n), N m.
        carried: inertial parameters of the load that is known beforehand, (10,).
        check: what first and second half leave of each other, (N, n), N m.
    """

    unknowns: Unknowns
    impulses: Impulses
    shapes: np.ndarray
    published: np.ndarray
    problem: Problem
    solution: Solution
    nominal: np.ndarray
    check: np.ndarray
    carried: np.ndarray

    def of(self, name: str) -> np.ndarray:
        """Return the values of some unknowns, (n,), or (10,) for the load."""
        return self.solution.value[self.unknowns.of(name)]

    def deviation(self, name: str) -> np.ndarray:
        """Return their standard deviations."""
        return np.sqrt(np.diag(self.solution.covariance)[self.unknowns.of(name)])

    def load(self) -> np.ndarray:
        """Return the inertial parameters of what is carried beside the description, (10,)."""
        return self.carried + (self.of("load") if self.unknowns.load else 0.0)

    def found(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return values and standard deviations of one of `names`, (n,) each; smooth friction counts as coulomb."""
        if name != "coulomb" or not self.unknowns.smooth:
            return self.of(name), self.deviation(name)
        dry, smooth, covariance = self.unknowns.of("coulomb"), self.unknowns.of("smooth"), self.solution.covariance
        variance = np.diag(covariance[dry, dry] + covariance[smooth, smooth] + 2.0 * covariance[dry, smooth])
        return self.of("coulomb") + self.of("smooth"), np.sqrt(np.maximum(variance, 0.0))

    @property
    def names(self) -> tuple[str, ...]:
        """What is told of each joint."""
        return tuple(name for name in self.unknowns.joints if name != "smooth")

    def losses(self) -> Losses:
        """Return what was found of each joint but its rotor.

        Steps that are steeper than `DRY_STEEP` are written as that.
        """
        bias, viscous, dry = (np.array(self.of(name)) for name in ("bias", "viscous", "coulomb"))
        smooth, (steep, shift) = np.zeros_like(bias), self.published.T.copy()
        if self.unknowns.smooth:
            smooth = np.array(self.of("smooth"))
        smoother = self.shapes[:, 0] < DRY_STEEP
        smooth, dry = np.where(smoother, dry, smooth), np.where(smoother, 0.0, dry)
        steep, shift = np.where(smoother, self.shapes[:, 0], steep), np.where(smoother, 0.0, shift)
        viscous = np.maximum(viscous, 0.0)
        if not self.unknowns.behind_gears:
            dry, smooth = np.maximum(dry, 0.0), np.maximum(smooth, 0.0)
        return Losses(bias, viscous, dry, smooth, steep, shift)


def fit(arm: Arm, signals: Signals, torque: np.ndarray, behind_gears: bool, carried: np.ndarray | None = None) -> Fit:
    """Fit a log.

    A payload is looked for where it makes each half of the log predict the other one better.

    Args:
        arm: by its description.
        signals: of the log.
        torque: which of its torques, (T, n), N m.
        behind_gears: whether that is measured behind the gears.
        carried: inertial parameters of a load that is known, (10,); None to look for one.
    """
    shapes = shapes_of(arm, behind_gears)
    impulses = impulses_of(arm, signals, torque, shapes)
    driving = impulses.driving
    if carried is not None:
        impulses = impulses._replace(driving=impulses.driving - impulses.load @ carried)
    chosen = _choose_shapes(arm, unknowns_of(arm, behind_gears, False), impulses)
    loads = (False, True) if carried is None else (False,)
    found = [_fit(arm, unknowns_of(arm, behind_gears, load), impulses, chosen) for load in loads]
    size = [_size(np.where(one[1].counts, one[2], 0.0), arm) for one in found]
    best = found[-1] if size[-1] < _CARRIES * size[0] else found[0]
    if best[0].load:  # with the load known, friction shows better
        chosen = _choose_shapes(arm, best[0], impulses)
        best = _fit(arm, best[0], impulses, chosen)
    unknowns, problem, check = best
    solution = _solve(unknowns, problem)
    nominal = problem_of(arm, unknowns_of(arm, behind_gears, False), impulses, np.ones(arm.n, dtype=int))
    return Fit(
        unknowns,
        impulses,
        np.stack(shapes)[chosen, np.arange(arm.n)],
        shapes[0],
        problem,
        solution,
        driving - nominal.columns @ nominal.mean,
        check,
        np.zeros(PARAMETERS) if carried is None else carried,
    )


def _fit(arm: Arm, unknowns: Unknowns, impulses: Impulses, chosen: np.ndarray) -> tuple[Unknowns, Problem, np.ndarray]:
    problem = problem_of(arm, unknowns, impulses, chosen)
    if unknowns.load:
        problem = _with_size(unknowns, problem)
    half = len(problem.torque) // 2
    check = np.empty_like(problem.torque)
    for seen, held_out in ((slice(0, half), slice(half, None)), (slice(half, None), slice(0, half))):
        found = _solve(unknowns, problem.part(seen))
        check[held_out] = problem.torque[held_out] - problem.columns[held_out] @ found.value
    return unknowns, problem, check


def _with_size(unknowns: Unknowns, problem: Problem) -> Problem:
    """Return the problem with a load's tensor expected to be that of a body where the load was first found."""
    load = unknowns.of("load")
    mass, moment = np.split(_solve(unknowns, problem).value[load][:4], [1])
    kg = float(mass[0])
    at = moment / kg if abs(kg) > 1e-3 else np.zeros(3)
    mean, spread = problem.mean.copy(), problem.spread.copy()
    mean[load][4:] = Inertia.of(kg, at, point_tensor(kg, at)).tensor
    spread[load][4:] = max(abs(kg), 0.1) * _SIZE_M**2
    return problem._replace(mean=mean, spread=spread)


def _solve(unknowns: Unknowns, problem: Problem) -> Solution:
    """Solve, and keep at zero what else would be negative and cannot be; that is no surer than it was without."""
    names = _NOT_NEGATIVE_BEHIND_GEARS if unknowns.behind_gears else _NOT_NEGATIVE
    pinned = np.zeros(len(problem.mean), dtype=bool)
    free = solution = solve(problem)
    while True:
        below = np.zeros_like(pinned)
        for name in set(names) & set(unknowns.joints):
            where = unknowns.of(name)
            below[where] = solution.value[where] < 0.0
        if not (below & ~pinned).any():
            if unknowns.smooth:  # their sum is told, for which both must be of one solution
                dry, smooth = unknowns.of("coulomb"), unknowns.of("smooth")
                pinned[dry] = pinned[smooth] = pinned[dry] | pinned[smooth]
            either = pinned[:, None] | pinned
            return solution._replace(covariance=np.where(either, free.covariance, solution.covariance))
        pinned |= below
        spread = np.where(pinned, _PINNED * problem.spread, problem.spread)
        problem = problem._replace(mean=np.where(pinned, 0.0, problem.mean), spread=spread)
        solution = solve(problem)


def _choose_shapes(arm: Arm, unknowns: Unknowns, impulses: Impulses) -> np.ndarray:
    """Return for each joint the friction shape that leaves least, the first where none does clearly better, (n,)."""
    chosen, least = np.ones(arm.n, dtype=int), np.full(arm.n, np.inf)
    for k in range(1, len(impulses.steps)):
        shape = np.full(arm.n, k)
        problem = problem_of(arm, unknowns, impulses, shape)
        squares = np.where(problem.counts, _solve(unknowns, problem).residual ** 2, 0.0)
        left = np.sqrt(np.mean(squares, axis=0))
        better = left < _CLEARLY * least
        chosen[better], least[better] = k, left[better]
    return chosen


def _size(residual: np.ndarray, arm: Arm) -> float:
    """Return how large residuals are, each joint's beside its torque limit."""
    return float(np.sum(np.mean(residual**2, axis=0) / arm.tau_max))
