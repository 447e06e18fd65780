"""Localisation: where on the arm or its tool something touches it, and with what force, as far as sensors can tell.

All places are compared by their `evidence`: a grid filter over the surface, in place of the particles of Manuelli &
Tedrake 2016. Several may explain the torques of one posture alike; as the arm moves on, what the postures before told
is remembered, for one force in the frame of the touched link, and the set shrinks. Where one force does not explain
the torques of now as well, it has changed: what was remembered is forgotten.
"""

import math

import numpy as np

from contactsafe.control.baseline import distance
from contactsafe.control.evidence import (
    Uncertainty,
    base_left_over,
    compare_into,
    force_into,
    left_over,
    link_of,
    most_by_noise,
)
from contactsafe.control.wrench_information import (
    inform,
    inform_of_base,
    information_dtype,
    marginalise_moment,
    told_base_dtype,
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

_AS_WELL = 0.05
"""A baseline holds as well as before where its weight is less by no more than this."""

_NEVER = -1e9


def localisation_dtype(n: int) -> np.dtype:
    """Describe what is known of a contact's place."""
    return np.dtype(
        [
            ("now", information_dtype(n)),  # what the torques of this sweep tell
            ("here", information_dtype(n)),  # what was told about this posture, where the baseline holds best
            ("before", information_dtype(n)),  # what was told in postures that the arm has left, their sum
            ("all", information_dtype(n)),  # both, the moment of a contact beside a place of the grid taken out
            ("constant", _f, (n,)),  # that came with that
            ("postures", _f),  # that are remembered
            ("weight", _f),  # of the baseline where `here` was told
            ("differs", _i),  # what is remembered contradicts the torques of now
            ("compared", _f, (MAX_PLACES,)),  # log of how well each place explains `all`, so far
            ("log", _f, (MAX_PLACES,)),  # of how probable each place was after the last whole sweep, up to a constant
            ("next", _i),  # place to be compared next
            ("torque", _f, (n,)),  # with which all places of a sweep are compared, N m
            ("sigma", _f, (n,)),  # its standard deviation, N m
            ("base", told_base_dtype),  # with which they are compared as well
            ("moment_variance", _f),  # see `Uncertainty`
            ("tool_prior", _f),  # probability of the tool beforehand
            ("turn", _i),  # sweeps over all places since the contact began
            ("q", _f, (n,)),  # posture of `here`, rad
            ("best", _i),  # most probable place on the most probable link, −1 for none
            ("link", _i),  # that link, n + 1 for the tool, 0 for none
            ("tool_probability", _f),  # of the tool
            ("left_over", _f),  # of the torque at the best point, over the most that noise leaves; smoothed
            ("force", _f, (3,)),  # of the environment at the best point, world, N
            ("point", _f, (3,)),  # the best point, world, m
        ]
    )


@compiled
def forget_place(place: Record) -> None:
    """Begin with a contact that may be anywhere."""
    place.next, place.turn, place.differs = 0, 0, 0
    place.best, place.link, place.tool_probability = -1, 0, 0.0
    place.force[:], place.point[:], place.left_over = 0.0, 0.0, 0.0


@compiled
def localise(
    place: Record, handle: Record, torque: Vector, known: Uncertainty, base: Record, q: Vector, weight: float,
    tool_prior: float, dt: float,
) -> None:  # fmt: skip
    """Compare the next places of the surface, all of them in the first tick of a contact.

    Args:
        place: `localisation_dtype` record; advanced.
        handle: of the nominal model, up to date.
        torque, known: external, (n,), N m, and how well it is known.
        base: what a sensor under the base tells: a record that has the fields of `told_base_dtype`.
        q, dt: posture, (n,), rad, and the time that passed, s.
        weight: of the baseline here, 0 … 1.
        tool_prior: probability of the tool before anything is known.
    """
    points = handle.place_points
    if place.next == 0:
        place.torque[:], place.sigma[:], place.moment_variance = torque, known.sigma, known.moment_variance
        place.tool_prior = tool_prior
        place.base.told, place.base.wrench[:], place.base.sigma[:] = base.told, base.wrench, base.sigma
        inform(place.now, handle, torque, known.sigma)
        inform_of_base(place.now, handle, place.base)
        _remember(place, q, weight)
        _add_up(place)
    stop = points if place.turn == 0 else min(place.next + round(_POINTS_A_S * dt), points)
    compare_into(handle, place.all, place.constant, place.next, stop, place.compared)
    place.next = stop % points
    if place.next > 0:
        return
    place.turn += 1
    _conclude(place, handle, torque.shape[0], points)
    _check(place, handle, Uncertainty(place.sigma, place.moment_variance))


@compiled
def _remember(place: Record, q: Vector, weight: float) -> None:
    """Keep what is told of a posture where the baseline holds best; add it to the memory once the arm has left."""
    if place.turn == 0 or place.differs != 0:
        place.before.G[:], place.before.h[:], place.postures, place.weight = 0.0, 0.0, 0.0, 0.0
        place.q[:] = q
    elif distance(q, place.q) > _MOVED_RAD:
        keep = min(1.0, (_POSTURES - 1.0) / max(place.postures, 1.0))
        place.before.G[:] = keep * place.before.G + place.here.G
        place.before.h[:] = keep * place.before.h + place.here.h
        place.postures, place.weight = keep * place.postures + 1.0, 0.0
        place.q[:] = q
    if weight >= place.weight - _AS_WELL:
        place.here.G[:], place.here.h[:], place.weight = place.now.G, place.now.h, weight


@compiled
def _add_up(place: Record) -> None:
    """Add up what all postures tell, and take the moment of a contact beside a place out."""
    place.all.G[:] = place.before.G + place.here.G
    place.all.h[:] = place.before.h + place.here.h
    for k in range(place.constant.shape[0]):
        place.constant[k] = marginalise_moment(place.all.G[k], place.all.h[k], place.moment_variance)


@compiled
def _conclude(place: Record, handle: Record, n: int, points: int) -> None:
    """Find the most probable link, the most probable place on it, and the force there."""
    total, probability = 0.0, stack_vector(n + 2)
    probability[:] = 0.0
    best = _weigh(place, handle, points)
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
    _average(place, handle, n, points)


@compiled
def _check(place: Record, handle: Record, known: Uncertainty) -> None:
    """Tell whether what is remembered contradicts the torques of now, and how well any single contact explains these.

    A single contact leaves n − 3 numbers free, and six more by a sensor under the base.
    """
    n = place.torque.shape[0]
    if place.best < 0:
        return
    link, told = min(place.link, n), n + (6.0 if place.base.told != 0 else 0.0)
    free = told - 3.0
    point, force = stack_vector(3), stack_vector(3)
    force_into(handle, place.all, place.best, n, point, force)
    left = _left_of_all(place, handle, link, known, point, force)
    place.differs = 1 if left > most_by_noise(told) else 0
    if free < 1.0:
        return
    marginalise_moment(place.now.G[link - 1], place.now.h[link - 1], known.moment_variance)
    force_into(handle, place.now, place.best, n, point, force)
    left = _left_of_all(place, handle, link, known, point, force) / most_by_noise(free)
    place.left_over += (1.0 if place.turn == 1 else _CHECK) * (left - place.left_over)


@compiled
def _left_of_all(place: Record, handle: Record, link: int, known: Uncertainty, point: Vector, force: Vector) -> float:
    """Return what a force on a link leaves over of torques and wrench at the base."""
    left = left_over(handle, link, place.torque, known, point, force)
    if place.base.told != 0:
        left += base_left_over(place.base, known.moment_variance, point, force)
    return left


@compiled
def _weigh(place: Record, handle: Record, points: int) -> float:
    """Fill the log of each place's probability, up to a constant, and return the largest."""
    tool, best = max(handle.tool_places, 1), _NEVER
    of_arm = math.log((1.0 - place.tool_prior) / max(points - tool, 1))
    of_tool = math.log(place.tool_prior / tool)
    for index in range(points):
        place.log[index] = place.compared[index] + (of_tool if index >= points - tool else of_arm)
        best = max(best, place.log[index])
    return best


@compiled
def _average(place: Record, handle: Record, n: int, points: int) -> None:
    """Set point and force to the mean over the places about the best one, on the same part, by their probability."""
    best, total = place.log[place.best], 0.0
    point, force, centre = stack_vector(3), stack_vector(3), stack_vector(3)
    force_into(handle, place.all, place.best, n, centre, force)
    place.point[:], place.force[:] = 0.0, 0.0
    for index in range(points):
        weight = math.exp(max(place.log[index] - best, -60.0))
        if weight < _NEGLIGIBLE or link_of(handle, index, n) != place.link:
            continue
        force_into(handle, place.all, index, n, point, force)
        if (point[0] - centre[0]) ** 2 + (point[1] - centre[1]) ** 2 + (point[2] - centre[2]) ** 2 > _ABOUT_M**2:
            continue
        total += weight
        for k in range(3):
            place.point[k] += weight * point[k]
            place.force[k] += weight * force[k]
    for k in range(3):
        place.point[k] /= total
        place.force[k] /= total
