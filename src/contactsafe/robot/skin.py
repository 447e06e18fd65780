"""The skin of an arm: points of its surface where something may touch it, and the way that thing can push there."""

import math

import numpy as np

from contactsafe.robot.facts import ArmFacts, Capsule

SKIN_COLUMNS = 7
"""Link 1 … n, point x y z in the link's frame, m, outward normal x y z."""

_ALONG, _AROUND = 5, 12


def capsule_skin(facts: ArmFacts) -> np.ndarray:
    """Sample the capsules of an arm's links, (P, 7) rows as in `SKIN_COLUMNS`.

    Link 1 is left out: what touches it can only turn it about its own axis, and joint torques show next to nothing.
    """
    rows = [
        _capsule_points(index, capsule)
        for index, link in enumerate(facts.links, start=1)
        if index > 1
        for capsule in link.capsules
    ]
    return np.concatenate(rows)


def _capsule_points(link: int, capsule: Capsule) -> np.ndarray:
    start, end = np.array(capsule.start), np.array(capsule.end)
    axis = (end - start) / np.linalg.norm(end - start)
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    rows = []
    for share in np.linspace(0.0, 1.0, _ALONG):
        for turn in np.arange(_AROUND) * 2 * math.pi / _AROUND:
            normal = math.cos(turn) * side + math.sin(turn) * other
            rows.append([link, *(start + share * (end - start) + capsule.radius * normal), *normal])
    return np.array(rows)
