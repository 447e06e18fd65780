"""What joint torques themselves tell of a contact's place: the posterior over the arm's surface, its noise known.

An estimator's own errors come from what it must find out beside: masses, noise, when the contact began. Here the true
torque of the contact is given with the noise of the sensors alone, and the points are closer to each other, so no
estimator does better than by luck. Written apart from the estimator, with the same assumptions of what force there may
be (docs/concepts/localisation.md).
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

    def likeliest(self, fraction: float) -> np.ndarray:
        """Return which points together have a fraction of the probability, likeliest first."""
        order = np.argsort(-self.probability, kind="stable")
        return order[: int(np.searchsorted(np.cumsum(self.probability[order]), fraction * (1.0 - 1e-12))) + 1]


def belief(
    surface: Surface, q: Sequence[np.ndarray], torque: Sequence[np.ndarray], sigma: float, tool_prior: float
) -> Belief:
    """Return the posterior over a surface after the torques of some postures; points where the last has them.

    Args:
        surface: of the arm.
        q: postures, each (n,), rad.
        torque: of the contact in each, with the noise of the sensors, (n,), N m.
        sigma: standard deviation of that noise, N m.
        tool_prior: probability of the tool beforehand.
    """
    on_tool = surface.on_tool
    tools = max(int(on_tool.sum()), 1)
    prior = np.where(on_tool, tool_prior / tools, (1.0 - tool_prior) / max(len(on_tool) - tools, 1))
    with np.errstate(divide="ignore"):
        log = np.log(prior)
    for posture, felt in zip(q, torque, strict=True):
        log += _evidence(surface, posture, felt, sigma)
    probability = np.exp(log - log.max())
    return Belief(surface.links, surface.at(q[-1])[0], probability / probability.sum())


def is_no_single(surface: Surface, q: np.ndarray, torque: np.ndarray, sigma: float) -> bool:
    """Tell whether no single force, whatever it is, on any point of the links explains a torque.

    What is left of it where it is explained best would be so large by noise in fewer than one of a hundred contacts.

    Args:
        surface: of the arm.
        q: (n,), rad.
        torque: with the noise of the sensors, (n,), N m.
        sigma: standard deviation of that noise, N m.
    """
    points, _ = surface.at(q)
    anywhere = np.full((len(points), 3, 3), _SINGLE_N**2 * np.eye(3))
    C, _ = _covariance(surface, q, (points, anywhere), torque, sigma)
    left = np.linalg.solve(C, np.broadcast_to(torque[:, None], (len(points), len(torque), 1)))[..., 0] @ torque
    free = max(len(torque) - 3, 1)
    most = free * (1.0 - 2.0 / (9.0 * free) + _Z_99 * math.sqrt(2.0 / (9.0 * free))) ** 3  # Wilson & Hilferty 1931
    return bool(left[~surface.on_tool].min() > most)


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


def _covariance(
    surface: Surface, q: np.ndarray, forces: tuple[np.ndarray, np.ndarray], torque: np.ndarray, sigma: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the covariance of the torque if the contact is at each point, (P, n, n), and the Jacobians, (P, 3, n).

    Args:
        surface, q, torque, sigma: as of `belief`.
        forces: points, (P, 3), m, and covariance of the force there, (P, 3, 3), N².
    """
    points, S = forces
    J, J_angular = jacobians(surface.arm, q, points, surface.links)
    moment = (0.5 * surface.apart * np.linalg.norm(torque) / _LEVER_M) ** 2
    C = sigma**2 * np.eye(len(torque)) + J.swapaxes(1, 2) @ S @ J
    return C + moment * J_angular.swapaxes(1, 2) @ J_angular, J


def _evidence(surface: Surface, q: np.ndarray, torque: np.ndarray, sigma: float) -> np.ndarray:
    """Return the log of the probability of a torque if the contact is at each point, up to a constant, (P,)."""
    points, normals = surface.at(q)
    S = force_covariance(normals, np.where(surface.on_tool, NORMAL_N, ACROSS_N))
    C, J = _covariance(surface, q, (points, S), torque, sigma)
    explained = np.linalg.solve(C, np.broadcast_to(torque[:, None], (len(points), len(torque), 1)))[..., 0]
    log = -0.5 * explained @ torque - 0.5 * np.linalg.slogdet(C)[1]
    SJ = S @ J
    outwards = np.einsum("pi,pij,pj->p", normals, SJ, explained)
    left = S - SJ @ np.linalg.solve(C, SJ.swapaxes(1, 2))
    spread = np.sqrt(np.maximum(np.einsum("pi,pij,pj->p", normals, left, normals), 0.0))
    inwards = math.log(2.0) - np.logaddexp(0.0, _LOGISTIC * outwards / np.maximum(spread, 1e-9))
    return log + np.where(surface.on_tool, 0.0, inwards)


def force_covariance(normals: np.ndarray, across_n: np.ndarray) -> np.ndarray:
    """Return the covariance of a contact's force beforehand at points with these normals (P, 3), (P, 3, 3), N²."""
    along = normals[:, :, None] * normals[:, None]
    variance = (across_n**2)[:, None, None]
    return NORMAL_N**2 * along + variance * (np.eye(3) - along)


def force_at(
    arm: Arm, q: np.ndarray, touched: tuple[int, np.ndarray, np.ndarray], torque: np.ndarray, sigma: float
) -> np.ndarray:
    """Return the likeliest force where the place is known, world, (3,), N.

    Args:
        arm: built from a description.
        q: (n,), rad.
        touched: link, point, and normal of either sign there, world, (3,) m and (3,).
        torque: of the contact, (n,), N m.
        sigma: its standard deviation, N m.
    """
    link, point, normal = touched
    (J,), _ = jacobians(arm, q, point[None], np.array([link]))
    S = force_covariance(normal[None], np.array([ACROSS_N]))[0]
    return S @ J @ np.linalg.solve(sigma**2 * np.eye(arm.n) + J.T @ S @ J, torque)
