"""What a policy's network sees: the vectors it observes and the latent, one after the other, each at its scale."""

from dataclasses import dataclass

import numpy as np

ACTION_SIZE = 18
"""Numbers of an action: increments of x_d, K1 and D1, six each."""

OBSERVED = {"pose": 6, "target": 18, "force": 3}
"""What a policy may observe besides the mask, and how many numbers each; `WipingEnv` says what they are."""

SCALES = {
    # Middle of the board and half the ink area, a hand's breadth of height, m; rad.
    "pose": ((0.5, 0.0, 0.01, 0.0, 0.0, 0.0), (0.15, 0.15, 0.03, 0.1, 0.1, 0.1)),
    # How far x_d leads, m and rad; then K1, 1/s², and D1, 1/s, by the middle and half the range of what actions reach.
    "target": (
        (*6 * [0.0], *3 * [150.0], *3 * [450.0], *3 * [25.0], *3 * [42.0]),
        (0.03, 0.03, 0.01, 0.03, 0.03, 0.03, *3 * [60.0], *3 * [150.0], *3 * [8.0], *3 * [10.0]),
    ),
    # What gentle wiping presses with, N.
    "force": ((0.0, 0.0, 0.0), (5.0, 5.0, 5.0)),
}
"""Centre and scale of the vectors that the task offers."""

MIN_STD = 0.2
"""A latent number that hardly moves is not blown up to unit variance: it would be noise."""


@dataclass(frozen=True)
class ObservationScaling:
    """Fixed scaling of [vectors, latent]; nothing that runs along, so nothing to be forgotten beside a policy.

    Attributes:
        observes: names of the vectors, in order.
        centre: (k,) subtracted first.
        scale: (k,) divided by.
        clip: largest magnitude afterwards.
    """

    observes: tuple[str, ...]
    centre: tuple[float, ...]
    scale: tuple[float, ...]
    clip: float = 8.0

    @classmethod
    def from_statistics(cls, observes, latent_mean, latent_std, clip=8.0):
        """Join the vectors' stated scaling with the latent's measured one."""
        centre = [*(c for name in observes for c in SCALES[name][0]), *latent_mean]
        scale = [*(s for name in observes for s in SCALES[name][1]), *np.maximum(latent_std, MIN_STD)]
        return cls(tuple(observes), tuple(float(c) for c in centre), tuple(float(s) for s in scale), clip)

    def __call__(self, observation, latent):
        """Scale what N environments observe, (N, j) each, and their latents (N, l): (N, k) float32."""
        raw = np.concatenate([*(np.asarray(observation[name], np.float32) for name in self.observes), latent], axis=1)
        centre, scale = np.asarray(self.centre, np.float32), np.asarray(self.scale, np.float32)
        return np.clip((raw - centre) / scale, -self.clip, self.clip).astype(np.float32)

    def as_dict(self):
        """Give centre, scale and clip as plain values."""
        return {"centre": list(self.centre), "scale": list(self.scale), "clip": self.clip}
