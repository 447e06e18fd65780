"""Whether postures are free: of the arm itself, by the capsules of its description, and of a floor."""

import numpy as np

from contactsafe.robot.arm import Arm, description_and_tool
from contactsafe.robot.shape import arm_capsules

_LEAST_M = 0.02
"""Between the arm and the floor, and between parts of it that are not neighbours; of those that are close at home, half
of what they have there."""


class Clearance:
    """What an arm may run into while nothing else is there.

    Args:
        arm: with a description and a tool.
        floor_m: height of the floor, world, m; None for none.

    Raises:
        InvalidInputError: nobody says what shape the arm has.
    """

    def __init__(self, arm: Arm, floor_m: float | None = None) -> None:
        self._parts, self._floor = description_and_tool(arm), floor_m
        starts, ends, radii, owners = arm_capsules(*self._parts, arm.home[None])
        first, second = np.triu_indices(len(radii), 1)
        apart = np.abs(owners[first] - owners[second]) > 1
        if arm.tool is not None:  # the tool is fixed to the last link
            apart &= ~((owners[first] >= arm.n - 1) & (owners[second] == arm.n + 1))
        self._pairs = first[apart], second[apart]
        at_home = self._gaps(starts, ends, radii)[0]
        shown = at_home > 0.0  # hulls of near neighbours that overlap never part
        self._pairs = self._pairs[0][shown], self._pairs[1][shown]
        self._least = np.minimum(_LEAST_M, 0.5 * at_home[shown])
        self._above = owners >= 2

    def is_free(self, q: np.ndarray) -> bool:
        """Tell whether the arm touches neither itself nor the floor in any of some postures, (F, n), rad."""
        starts, ends, radii, _ = arm_capsules(*self._parts, q)
        if self._floor is not None:
            lowest = np.minimum(starts[:, :, 2], ends[:, :, 2]) - radii
            if (lowest[:, self._above] < self._floor + _LEAST_M).any():
                return False
        return not (self._gaps(starts, ends, radii) < self._least).any()

    def _gaps(self, starts: np.ndarray, ends: np.ndarray, radii: np.ndarray) -> np.ndarray:
        """Return the distances of the pairs of capsules, (F, pairs), m."""
        first, second = self._pairs
        apart = segment_distance(starts[:, first], ends[:, first], starts[:, second], ends[:, second])
        return apart - radii[first] - radii[second]


def segment_distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return the distance of segments a to b and c to d, (..., 3) each.

    Ericson, Real-Time Collision Detection, 5.1.9.
    """
    u, v, r = b - a, d - c, a - c
    uu, vv, uv = np.sum(u * u, -1) + 1e-12, np.sum(v * v, -1) + 1e-12, np.sum(u * v, -1)
    ur, vr = np.sum(u * r, -1), np.sum(v * r, -1)
    slack = uu * vv - uv * uv
    s = np.clip(np.where(slack > 1e-12, (uv * vr - ur * vv) / np.maximum(slack, 1e-12), 0.0), 0.0, 1.0)
    t = np.clip((uv * s + vr) / vv, 0.0, 1.0)
    s = np.clip((uv * t - ur) / uu, 0.0, 1.0)
    return np.linalg.norm(r + s[..., None] * u - t[..., None] * v, axis=-1)
