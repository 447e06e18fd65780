"""What sensors themselves tell of a contact's place: the posterior over the arm's surface, their noise known.

An estimator's own errors come from what it must find out beside: masses, noise, when the contact began. Here the true
torque of the contact is given with the noise of the sensors alone, and the points are closer to each other, so no
estimator does better than by luck. A sensor under the base tells six more numbers, behind the torques of a posture:
force and moment about the world's origin. Written apart from the estimator, with the same assumptions of what force
there may be (docs/concepts/localisation.md).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.shape import link_frames
from contactsafe.robot.surface import POINTS
from contactsafe.robot.touchable import capsule_places, touchable

NORMAL_N, ACROSS_N = 30.0, 10.0
"""Standard deviations of the force along the normal and across it."""

TOOL_PRIOR = 0.4
"""Probability of the tool beforehand, without a wrench that rules it out."""

_LEVER_M = 0.5  # lever arm by which a torque is taken for a force
_ABOUT_M = 0.05
_LOGISTIC = 1.702  # of a logistic distribution that is nearly the normal one


Sigma = float | np.ndarray
"""Standard deviation of noise, one for all numbers or one for each."""

_BESIDE = 0.35  # a contact is beside its point by this part of how far they are apart, standard deviation along an axis
_FINE = 5  # points of the finer grid, in a row
_POSSIBLE = 12.0  # log of how much less probable than the best a point may seem before a finer grid tells
_NEAREST = 100  # points about which the finer grid looks for a single contact
_SINGLE_N = 100.0  # standard deviation of a force of which nothing is known
_Z_99 = 2.326  # standard normal number below which are 99 %


@dataclass(frozen=True)
class Surface:
    """Points of an arm and its tool, twice as close to each other as those of the estimator.

    Attributes:
        arm: built from a description.
        rows: as in `touchable`, (P, 7).
        apart: how far the points of the links are apart, m.
    """

    arm: Arm
    rows: np.ndarray
    apart: float

    @property
    def on_tool(self) -> np.ndarray:
        """Whether each point is on the tool, (P,)."""
        return self.rows[:, 0] == 0.0

    @property
    def links(self) -> np.ndarray:
        """Link of each, n + 1 for the tool, (P,)."""
        return np.where(self.on_tool, self.arm.n + 1, self.rows[:, 0]).astype(int)

    def at(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the points in a posture and the outward normals there, world, (P, 3) m and (P, 3)."""
        description, tool = description_and_tool(self.arm)
        origins, rotations = (frames[0] for frames in link_frames(description, q[None]))
        local = self.rows[:, 1:4] + self.on_tool[:, None] * np.array(tool.tcp)
        points = origins[self.links] + np.einsum("pij,pj->pi", rotations[self.links], local)
        return points, np.einsum("pij,pj->pi", rotations[self.links], self.rows[:, 4:])

    def refined(self, chosen: np.ndarray) -> "Surface":
        """Return a finer grid about some of the points, indices (K,): `_FINE` squared in place of each, in its order.

        They lie in the plane that touches the surface at their point, from which it is a fraction of a millimetre away.
        """
        normals = self.rows[chosen, 4:]
        across = np.cross(normals, np.eye(3)[np.argmin(np.abs(normals), axis=1)])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        steps = self.apart * ((np.arange(_FINE) + 0.5) / _FINE - 0.5)
        u, v = (offsets.ravel() for offsets in np.meshgrid(steps, steps))
        rows = np.repeat(self.rows[chosen], _FINE**2, axis=0)
        rows[:, 1:4] += np.tile(u, len(chosen))[:, None] * np.repeat(across, _FINE**2, axis=0)
        rows[:, 1:4] += np.tile(v, len(chosen))[:, None] * np.repeat(np.cross(normals, across), _FINE**2, axis=0)
        return Surface(self.arm, rows, self.apart / _FINE)


def dense_surface(arm: Arm) -> Surface:
    """Return the surface over which the limit is computed."""
    description, tool = description_and_tool(arm)
    rows = touchable(capsule_places(description, 4 * POINTS), tool)
    return Surface(arm, rows, spacing(rows))


def spacing(places: np.ndarray) -> float:
    """Return how far apart the places of an arm's links are, median of each one's nearest of the same link, m.

    A true point counts as in a set of places where one of its link is no further from it. That is so for all but one
    in a hundred points of a Panda's surface; the others are half a centimetre further.

    Args:
        places: rows as in `touchable`, (P, 7).
    """
    nearest: list[float] = []
    for link in np.unique(places[places[:, 0] > 0.0, 0]):
        points = places[places[:, 0] == link, 1:4]
        if len(points) > 1:
            gaps = np.linalg.norm(points[:, None] - points, axis=2)
            nearest += (gaps + np.diag(np.full(len(points), np.inf))).min(axis=1).tolist()
    return float(np.median(nearest))


@dataclass(frozen=True)
class Belief:
    """Where a contact may be.

    Attributes:
        links: of the surface's points, n + 1 for the tool, (P,).
        points: world, (P, 3), m.
        probability: of each, (P,).
    """

    links: np.ndarray
    points: np.ndarray
    probability: np.ndarray

    def best(self) -> tuple[int, np.ndarray]:
        """Return the likeliest link, and the mean of the place that most probably is right within 5 cm, (3,), m."""
        some = self.likeliest(0.999)
        points, probability = self.points[some], self.probability[some]
        near = np.linalg.norm(points[:, None] - points, axis=2) < _ABOUT_M
        about = near[np.argmax(near @ probability)] * probability
        link = np.argmax(np.bincount(self.links, weights=self.probability))
        return int(link), about @ points / about.sum()

    def given(self, allowed: np.ndarray) -> "Belief":
        """Return what is believed once the contact is known to be on some of the points, booleans (P,)."""
        left = np.where(allowed, self.probability, 0.0)
        return Belief(self.links, self.points, left / left.sum())

    def likeliest(self, fraction: float) -> np.ndarray:
        """Return which points together have a fraction of the probability, likeliest first."""
        order = np.argsort(-self.probability, kind="stable")
        return order[: int(np.searchsorted(np.cumsum(self.probability[order]), fraction * (1.0 - 1e-12))) + 1]


def belief(
    surface: Surface, q: Sequence[np.ndarray], torque: Sequence[np.ndarray], sigma: Sigma, tool_prior: float
) -> Belief:
    """Return the posterior over a surface after the torques of some postures; points where the last has them.

    The force is the same in all of them, in the frame of the touched link.

    Args:
        surface: of the arm.
        q: postures, each (n,), rad.
        torque: of the contact in each, with the noise of the sensors, (n,), N m; or (n + 6,), the base's behind them.
        sigma: standard deviation of that noise, one number or one each, N m and N.
        tool_prior: probability of the tool beforehand.
    """
    on_tool = surface.on_tool
    tools = max(int(on_tool.sum()), 1)
    prior = np.where(on_tool, tool_prior / tools, (1.0 - tool_prior) / max(len(on_tool) - tools, 1))
    with np.errstate(divide="ignore"):
        log = np.log(prior)
    rough = log + _evidence(surface, q, torque, sigma)
    chosen = np.flatnonzero(rough > rough.max() - _POSSIBLE)
    log = np.repeat(log[chosen], _FINE**2) + _evidence(surface.refined(chosen), q, torque, sigma)
    probability = np.zeros(len(prior))
    probability[chosen] = np.exp(log - log.max()).reshape(len(chosen), -1).sum(axis=1)
    return Belief(surface.links, surface.at(q[-1])[0], probability / probability.sum())


def is_no_single(surface: Surface, q: Sequence[np.ndarray], torque: Sequence[np.ndarray], sigma: Sigma) -> bool:
    """Tell whether no single force that turns with its link, on any point of the links, explains torques.

    What is left of them where they are explained best would be so large by noise in fewer than one of a hundred.

    Args:
        surface: of the arm.
        q: postures, each (n,), rad.
        torque, sigma: as in `belief`.
    """
    on_links = np.flatnonzero(~surface.on_tool)
    nearest = np.argsort(_left_over(surface, q, torque, sigma)[on_links])[:_NEAREST]
    left = _left_over(surface.refined(on_links[nearest]), q, torque, sigma)
    free = max(sum(map(len, torque)) - 3, 1)
    most = free * (1.0 - 2.0 / (9.0 * free) + _Z_99 * math.sqrt(2.0 / (9.0 * free))) ** 3  # Wilson & Hilferty 1931
    return bool(left.min() > most)


def jacobians(arm: Arm, q: np.ndarray, points: np.ndarray, links: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the Jacobians of points on links, of their velocity and angular velocity, each (P, 3, n).

    Args:
        arm: built from a description.
        q: (n,), rad.
        points: world, (P, 3), m.
        links: of each, 1 … n; more for the tool, (P,).
    """
    origins, rotations = (frames[0, 1:-1] for frames in link_frames(description_and_tool(arm)[0], q[None]))
    axes = rotations[:, :, 2]
    moved = np.arange(arm.n) < links[:, None]
    linear = np.cross(axes, points[:, None] - origins) * moved[..., None]
    return linear.swapaxes(1, 2), (axes * moved[..., None]).swapaxes(1, 2)


@dataclass(frozen=True)
class _Information:
    """What torques tell of one force on each point, the same in the link's frame in all postures.

    Attributes:
        A: of the force, (P, 3, 3), 1/N².
        b: A times the force, (P, 3), 1/N.
        log: of the probability of the torques if there were no force, up to a constant, (P,).
        left: square of the torques over the noise's variance, (P,).
    """

    A: np.ndarray
    b: np.ndarray
    log: np.ndarray
    left: np.ndarray


def _information(surface: Surface, q: Sequence[np.ndarray], torque: Sequence[np.ndarray], sigma: Sigma) -> _Information:
    """Add up over postures what the torques tell; a contact beside its point has a moment about it as well.

    Each number over its own noise, that of a posture has the covariance N = I + s² J_ωᵀ J_ω; its inverse is that of
    Woodbury.
    """
    count, n = len(surface.rows), surface.arm.n
    A, b, log, left = np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    for posture, felt in zip(q, torque, strict=True):
        rotations = link_frames(description_and_tool(surface.arm)[0], posture[None])[1][0, surface.links]
        J, turns = _shown(surface.arm, posture, surface.at(posture)[0], surface.links, len(felt) > n)
        scale = np.broadcast_to(sigma, felt.shape)
        local, turns, seen = rotations.swapaxes(1, 2) @ J / scale, turns / scale, felt / scale
        moment = (_BESIDE * surface.apart * np.linalg.norm(felt[:n]) / _LEVER_M) ** 2 + 1e-12
        inner = np.linalg.inv(np.eye(3) / moment + turns @ turns.swapaxes(1, 2))
        known_local = local - (local @ turns.swapaxes(1, 2)) @ inner @ turns  # times N⁻¹
        known_seen = seen - (((turns @ seen)[:, None] @ inner) @ turns)[:, 0]
        A += known_local @ local.swapaxes(1, 2)
        b += known_local @ seen
        left += known_seen @ seen
        log += 0.5 * np.linalg.slogdet(inner / moment)[1] - np.log(scale).sum()
    return _Information(A, b, log - 0.5 * left, left)


def _shown(arm: Arm, q: np.ndarray, points: np.ndarray, links: np.ndarray, base: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return what turns a force and a moment at points into what is felt of it, (P, 3, n) each, 6 more with a base."""
    linear, angular = jacobians(arm, q, points, links)
    if not base:
        return linear, angular
    unit = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    levers = np.cross(np.eye(3), points[:, None]).swapaxes(1, 2)  # f · (e × p) = e · (p × f)
    return np.concatenate([linear, unit, levers], axis=2), np.concatenate([angular, 0.0 * unit, unit], axis=2)


def _left_over(surface: Surface, q: Sequence[np.ndarray], torque: Sequence[np.ndarray], sigma: Sigma) -> np.ndarray:
    """Return what a force on each point leaves of the torques, its square over the noise's variance, (P,)."""
    of = _information(surface, q, torque, sigma)
    force = np.linalg.solve(of.A + np.eye(3) / _SINGLE_N**2, of.b[..., None])[..., 0]
    return of.left - np.einsum("pi,pi->p", of.b, force)


def _evidence(surface: Surface, q: Sequence[np.ndarray], torque: Sequence[np.ndarray], sigma: Sigma) -> np.ndarray:
    """Return the log of the probability of torques if the contact is at each point, up to a constant, (P,)."""
    of, normals = _information(surface, q, torque, sigma), surface.rows[:, 4:]
    S = force_covariance(normals, np.where(surface.on_tool, NORMAL_N, ACROSS_N))
    covariance = np.linalg.inv(of.A + np.linalg.inv(S))
    force = np.einsum("pij,pj->pi", covariance, of.b)
    log = of.log + 0.5 * np.einsum("pi,pi->p", of.b, force)
    log += 0.5 * (np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(S)[1])
    spread = np.sqrt(np.einsum("pi,pij,pj->p", normals, covariance, normals))
    outwards = _LOGISTIC * np.einsum("pi,pi->p", normals, force) / spread
    return log + np.where(surface.on_tool, 0.0, math.log(2.0) - np.logaddexp(0.0, outwards))


def force_covariance(normals: np.ndarray, across_n: np.ndarray) -> np.ndarray:
    """Return the covariance of a contact's force beforehand at points with these normals (P, 3), (P, 3, 3), N²."""
    along = normals[:, :, None] * normals[:, None]
    variance = (across_n**2)[:, None, None]
    return NORMAL_N**2 * along + variance * (np.eye(3) - along)


def force_at(
    arm: Arm, q: np.ndarray, touched: tuple[int, np.ndarray, np.ndarray], torque: np.ndarray, sigma: Sigma
) -> np.ndarray:
    """Return the likeliest force where the place is known, world, (3,), N.

    Args:
        arm: built from a description.
        q: (n,), rad.
        touched: link, point, and normal of either sign there, world, (3,) m and (3,).
        torque, sigma: of one posture, as in `belief`.
    """
    link, point, normal = touched
    (J,), _ = _shown(arm, q, point[None], np.array([link]), len(torque) > arm.n)
    S = force_covariance(normal[None], np.array([ACROSS_N]))[0]
    return S @ J @ np.linalg.solve(np.diag(np.broadcast_to(sigma, torque.shape) ** 2) + J.T @ S @ J, torque)
