"""The set of places that explain the torques of a contact: joint torques alone cannot tell some of them apart."""

from typing import NamedTuple

import numpy as np

from contactsafe.control.evidence import force_into, link_of
from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.errors import InvalidInputError


class Place(NamedTuple):
    """One place that explains what is felt.

    Attributes:
        link: 1 … n; the tool is part of the last one.
        on_tool: whether it is on the tool.
        point: on the surface, world, (3,), m.
        force: of the environment there, if it is this one, world, (3,), N.
        probability: that it is.
    """

    link: int
    on_tool: bool
    point: np.ndarray
    force: np.ndarray
    probability: float


def places_of(records: np.ndarray, index: int, fraction: float) -> list[Place]:
    """Return the most probable places of a contact that together have a fraction of the probability, likeliest first.

    Args:
        records: `controller_dtype` records, one of them amid a contact.
        index: which.
        fraction: of the probability, 0 … 1.

    Raises:
        InvalidInputError: that is no fraction.
    """
    if not isinstance(fraction, int | float) or not 0.0 < fraction <= 1.0:
        raise InvalidInputError(f"fraction = {fraction!r} of the probability; give more than 0 and at most 1")
    record = records[index]
    state, handle = record["state"], record["handle"]
    points = int(handle["place_points"])
    if not state["touch"]["touching"] or state["localisation"]["best"] < 0:
        _list(records, index, np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)))  # compiles
        return []
    n = len(state["arm"]["q"])
    weights, links = np.zeros(points), np.zeros(points, dtype=np.int64)
    point, force = np.zeros((points, 3)), np.zeros((points, 3))
    _list(records, index, weights, links, point, force)
    probability = np.exp(weights - weights.max())
    probability /= probability.sum()
    order = np.argsort(-probability, kind="stable")
    count = int(np.searchsorted(np.cumsum(probability[order]), fraction * (1.0 - 1e-12))) + 1
    return [
        Place(min(int(links[k]), n), bool(links[k] > n), point[k], force[k], float(probability[k]))
        for k in order[:count]
    ]


@compiled(nogil=True)
def _list(records: np.ndarray, index: int, weights: Vector, links: np.ndarray, point: Matrix, force: Matrix) -> None:
    """Fill the log of each point's weight, its link, where it is and the likeliest force there."""
    c = records[index]
    found, n = c.state.localisation, c.state.arm.q.shape[0]
    for k in range(weights.shape[0]):
        weights[k] = found.log[k]
        links[k] = link_of(c.handle, k, n)
        force_into(c.handle, found.all, k, n, point[k], force[k])
