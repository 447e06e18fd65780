"""Localisation: where on the arm or its tool something touches it, and with what force, as far as torques can tell.

All places are compared by their `evidence`: a grid filter over the surface, in place of the particles of Manuelli &
Tedrake 2016. Several may explain the torques of one posture alike; as the arm moves on, what the postures before said
is remembered, and the set shrinks.
"""

import math

import numpy as np

from contactsafe.control.baseline import distance
from contactsafe.control.evidence import (
    Uncertainty,
    compare_into,
    force_into,
    left_over,
    link_of,
    most_by_noise,
    point_into,
)
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.stack import stack_vector
from contactsafe.robot.touchable import MAX_PLACES

_f = np.float64
_i = np.int64

_POINTS_A_S = 1e5
"""Places compared in a second: those of a Panda take 5 ms."""

_MOVED_RAD = 0.2
"""A posture this far from the last one counts as another."""

_POSTURES = 5.0
"""As many are remembered at most, the older the less: a contact may slide."""

_ABOUT_M, _NEGLIGIBLE = 0.05, 0.02
"""Point and force are a mean over what is so near to the best point, and no less probable than this part of it."""

_CHECK = 0.2
"""Of what a sweep leaves over that is taken over at once: contacts that come together look like several at first."""

_NEVER = -1e9


def localisation_dtype(n: int) -> np.dtype:
    """Describe what is known of a contact's place."""
    return np.dtype(
        [
            ("now", _f, (MAX_PLACES,)),  # log of how well each point explains the torques of this sweep, so far
            ("last", _f, (MAX_PLACES,)),  # the same of the last whole sweep
            ("memory", _f, (MAX_PLACES,)),  # the same of postures that the arm has left, their sum
            ("postures", _f),  # that are remembered
            ("log", _f, (MAX_PLACES,)),  # of how probable each point was after the last whole sweep, up to a constant
            ("next", _i),  # point to be compared next
            ("torque", _f, (n,)),  # with which all points of a sweep are compared, N m
            ("sigma", _f, (n,)),  # its standard deviation, N m
            ("moment_variance", _f),  # see `Uncertainty`
            ("tool_prior", _f),  # probability of the tool beforehand
            ("turn", _i),  # sweeps over all points since the contact began
            ("q", _f, (n,)),  # posture that is to be added to the memory next, rad
            ("best", _i),  # most probable point of the most probable link, −1 for none
            ("link", _i),  # that link, n + 1 for the tool, 0 for none
            ("tool_probability", _f),  # of the tool
            ("left_over", _f),  # of the torque at the best point, over the most that noise leaves; smoothed
            ("force", _f, (3,)),  # of the environment at the best point, world, N
            ("point", _f, (3,)),  # the best point, world, m
        ]
    )


@compiled
def forget_place(place: Record, q: Vector) -> None:
    """Begin with a contact that may be anywhere."""
    place.memory[:], place.postures, place.next, place.turn, place.q[:] = 0.0, 0.0, 0, 0, q
    place.best, place.link, place.tool_probability = -1, 0, 0.0
    place.force[:], place.point[:], place.left_over = 0.0, 0.0, 0.0


@compiled
def localise(
    place: Record, handle: Record, torque: Vector, known: Uncertainty, q: Vector, tool_prior: float, dt: float
) -> None:
    """Compare the next points of the surface, all of them in the first tick of a contact.

    Args:
        place: `localisation_dtype` record; advanced.
        handle: of the nominal model, up to date.
        torque, known: external, (n,), N m, and how well it is known.
        q, dt: posture, (n,), rad, and the time that passed, s.
        tool_prior: probability of the tool before anything is known.
    """
    points = handle.place_points
    if place.next == 0:
        place.torque[:], place.sigma[:], place.moment_variance = torque, known.sigma, known.moment_variance
        place.tool_prior = tool_prior
    stop = points if place.turn == 0 else min(place.next + round(_POINTS_A_S * dt), points)
    of_sweep = Uncertainty(place.sigma, place.moment_variance)
    compare_into(handle, place.torque, of_sweep, place.next, stop, place.now)
    place.next = stop % points
    if place.next > 0:
        return
    place.turn += 1
    _remember(place, q, points)
    _conclude(place, handle, place.torque, of_sweep, points)
    _check(place, handle, of_sweep)


@compiled
def _remember(place: Record, q: Vector, points: int) -> None:
    """Add what the torques said in a posture to the memory, once the arm has left it; keep what they say now."""
    if place.turn == 1:
        place.q[:] = q
    elif distance(q, place.q) > _MOVED_RAD:
        place.q[:] = q
        keep, best = min(1.0, (_POSTURES - 1.0) / max(place.postures, 1.0)), place.last[:points].max()
        place.postures = keep * place.postures + 1.0
        for index in range(points):
            place.memory[index] = keep * place.memory[index] + (place.last[index] - best)
    place.last[:points] = place.now[:points]


@compiled
def _conclude(place: Record, handle: Record, torque: Vector, known: Uncertainty, points: int) -> None:
    """Find the most probable link, the most probable point of it, and the force there."""
    n, total = torque.shape[0], 0.0
    probability = stack_vector(n + 2)
    probability[:] = 0.0
    best = _combine(place, handle, points)
    for index in range(points):
        weight = math.exp(max(place.log[index] - best, -60.0))
        probability[link_of(handle, index, n)] += weight
        total += weight
    link = 0
    for candidate in range(1, n + 2):
        if probability[candidate] > probability[link]:
            link = candidate
    place.link, place.best, best = link, -1, 2.0 * _NEVER
    place.tool_probability = probability[n + 1] / total
    for index in range(points):
        if link_of(handle, index, n) == link and place.log[index] > best:
            best, place.best = place.log[index], index
    _average(place, handle, torque, known, points)


@compiled
def _check(place: Record, handle: Record, known: Uncertainty) -> None:
    """Follow how well the best point explains the torque at all; a single contact leaves n − 3 numbers free."""
    free = place.torque.shape[0] - 3.0
    if free < 1.0:
        return
    left = left_over(handle, place.best, place.torque, known, stack_vector(3), stack_vector(3)) / most_by_noise(free)
    place.left_over += (1.0 if place.turn == 1 else _CHECK) * (left - place.left_over)


@compiled
def _combine(place: Record, handle: Record, points: int) -> float:
    """Fill the log of each place's probability, up to a constant, and return the largest.

    The errors of several postures are alike, a sensor's bias or a link's mass: what they say is added up as if there
    were only as many as the root of their number.
    """
    tool = max(handle.tool_places, 1)
    alike, best = math.sqrt(place.postures + 1.0), _NEVER
    of_arm = math.log((1.0 - place.tool_prior) / max(points - tool, 1))
    of_tool = math.log(place.tool_prior / tool)
    for index in range(points):
        prior = of_tool if index >= points - tool else of_arm
        place.log[index] = (place.now[index] + place.memory[index]) / alike + prior
        best = max(best, place.log[index])
    return best


@compiled
def _average(place: Record, handle: Record, torque: Vector, known: Uncertainty, points: int) -> None:
    """Set point and force to the mean over the points about the best one, on the same part, by their probability."""
    n, best, total = torque.shape[0], place.log[place.best], 0.0
    point, force, normal, centre = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    point_into(handle, place.best, n, centre, normal)
    place.point[:], place.force[:] = 0.0, 0.0
    for index in range(points):
        weight = math.exp(max(place.log[index] - best, -60.0))
        if weight < _NEGLIGIBLE or point_into(handle, index, n, point, normal) != place.link:
            continue
        if (point[0] - centre[0]) ** 2 + (point[1] - centre[1]) ** 2 + (point[2] - centre[2]) ** 2 > _ABOUT_M**2:
            continue
        force_into(handle, index, torque, known, point, force)
        total += weight
        for k in range(3):
            place.point[k] += weight * point[k]
            place.force[k] += weight * force[k]
    for k in range(3):
        place.point[k] /= total
        place.force[k] /= total
