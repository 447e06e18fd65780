"""Dither: a small steady motion added to what a policy asks for, as a hand makes while it works a surface.

The mean of a policy that has learned with noise can stand still between two goals that attract it equally, or before
one that the arm hides from the camera. Exploration noise had always carried it on; without, it stays there. A motion
that never rests does the same, and the same again for the same episode. Its two periods have the golden ratio, so that
it does not repeat itself.
"""

from dataclasses import dataclass

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.policy.rate import POLICY_RATE_HZ

_GOLDEN = (1.0 + 5.0**0.5) / 2.0


@dataclass(frozen=True)
class Dither:
    """The motion.

    Attributes:
        amplitude: along x and along y, as a fraction of the largest action; 0 for none.
        period_s: along x, s.
        rate_hz: of actions.
    """

    amplitude: float = 0.3
    period_s: float = 2.0
    rate_hz: float = float(POLICY_RATE_HZ)

    def __post_init__(self) -> None:
        """Refuse a motion that is none."""
        if not (0.0 <= self.amplitude <= 1.0 and 0.1 <= self.period_s <= 60.0 and 0.1 <= self.rate_hz <= 1000.0):
            raise InvalidInputError(
                f"dither amplitude = {self.amplitude}, period_s = {self.period_s}, rate_hz = {self.rate_hz}; "
                "give 0 ≤ amplitude ≤ 1, 0.1 ≤ period_s ≤ 60 and 0.1 ≤ rate_hz ≤ 1000"
            )

    def over(self, actions: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Add the motion to actions.

        Args:
            actions: (N, 18).
            steps: taken in each episode so far, (N,).

        Returns:
            (N, 18) float32, clipped to [-1, 1].
        """
        phase = 2.0 * np.pi * np.asarray(steps) / (self.period_s * self.rate_hz)
        moved = np.array(actions, dtype=np.float32)
        moved[:, 0] += self.amplitude * np.cos(phase)
        moved[:, 1] += self.amplitude * np.sin(_GOLDEN * phase)
        return np.clip(moved, -1.0, 1.0)
