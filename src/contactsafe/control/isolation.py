"""Isolation: which link is touched, at which lever arm, and in which direction of joint torque."""

import math

import numpy as np

from contactsafe.control.contact_geometry import best_point, contact_lever, surface_torque
from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled, inlined
from contactsafe.core.linalg import dot

_f = np.float64
_i = np.int64

_POINTS_A_TICK = 20
"""Points of the surface that are searched for the contact in one tick."""

_LEAST_LEVER = 0.03
"""No contact counts as nearer to all axes than this, m: its force would be anybody's guess."""

_LEVER_GAIN = 0.2
"""Of a newly found lever arm that is taken over at once."""


def isolation_dtype(n: int) -> np.dtype:
    """Describe what isolation remembers."""
    return np.dtype(
        [
            ("direction", _f, (n,)),  # unit joint-space direction of the contact's torque on the arm, last seen
            ("link", _i),  # that the contact is on, 1 … n; 0 where none was found yet
            ("lever", _f),  # joint torque per newton there, m
            ("lever_max", _f),  # the same, were the force not along the surface's normal, m
            ("search_at", _i),  # next point of the surface to be searched
            ("search_point", _i),  # best one of this search so far, −1 for none
            ("search_fit", _f),  # cosine between its torque and the one found
        ]
    )


@inlined
def isolate(isolation: Record, handle: Record, link: int, torque: Vector, lever_doubted: float) -> None:
    """Take the direction from the contact's torque, and look for its place on the surface.

    All of the surface is searched when a contact is found, later a part each tick. Lever arms are smoothed: a contact
    between two links would be now on the one, now on the other.

    Args:
        isolation: `isolation_dtype` record; advanced.
        handle: of the nominal model, up to date.
        link: the furthest that detection found, 1 … n; it stands where the arm has no surface samples.
        torque: of the contact on the arm, (n,), N m.
        lever_doubted: of the arm, m; see `best_point`.
    """
    isolation.direction[:] = torque / _size(torque)
    first = isolation.link == 0
    points = handle.surface_points
    if first or points == 0:
        _take_link(isolation, handle, link, _longest_lever(handle, link, isolation.direction), 1.0)
    if isolation.search_at == 0:
        isolation.search_point, isolation.search_fit = -1, 0.0
    stop = points if first else min(isolation.search_at + _POINTS_A_TICK, points)
    point_torque = np.empty(torque.shape[0])
    isolation.search_point, isolation.search_fit = best_point(
        handle, isolation.search_at, stop, isolation.direction, lever_doubted, point_torque,
        isolation.search_point, isolation.search_fit,
    )  # fmt: skip
    isolation.search_at = stop % points if points > 0 else 0
    if isolation.search_at == 0 and isolation.search_point >= 0:
        found = surface_torque(handle, isolation.search_point, point_torque)
        _take_link(isolation, handle, found, _size(point_torque), 1.0 if first else _LEVER_GAIN)


@compiled
def forget_contact(isolation: Record) -> None:
    """Begin the next search anew."""
    isolation.link, isolation.search_at = 0, 0


@compiled
def _size(x: Vector) -> float:
    return max(math.sqrt(dot(x, x)), 1e-9)


@compiled
def _longest_lever(handle: Record, link: int, direction: Vector) -> float:
    """Return the longest lever arm of the links that may be touched: near its joint a link shows less."""
    lever = 0.0
    for further in range(link, direction.shape[0] + 1):
        lever = max(lever, contact_lever(handle, further, direction))
    return lever


@compiled
def _take_link(isolation: Record, handle: Record, link: int, lever: float, gain: float) -> None:
    lever_max = max(lever, contact_lever(handle, link, isolation.direction))
    isolation.link = link
    isolation.lever += gain * (max(lever, _LEAST_LEVER) - isolation.lever)
    isolation.lever_max += gain * (max(lever_max, _LEAST_LEVER) - isolation.lever_max)
