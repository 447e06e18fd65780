"""A figure over seeds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Spread:
    """A figure over seeds; NaN where no trial has it.

    Attributes:
        median, mean, p5, p95, min, max: of the trials where the figure exists.
        n: how many those are.
        on_mean: whether its middle is the mean.
    """

    median: float
    mean: float
    p5: float
    p95: float
    min: float
    max: float
    n: int
    on_mean: bool = False

    @property
    def middle(self) -> float:
        """Median, or mean where `on_mean`."""
        return self.mean if self.on_mean else self.median

    def centred_on_mean(self) -> "Spread":
        """Return the same spread with its mean as its middle."""
        return replace(self, on_mean=True)

    def as_dict(self) -> dict[str, float]:
        """Return the statistics by name."""
        return {name: getattr(self, name) for name in ("median", "mean", "p5", "p95", "min", "max", "n")}


def spread(values: Sequence[float]) -> Spread:
    """Summarise one figure over seeds; trials where it does not exist (NaN) are left out."""
    numbers = np.array([value for value in values if np.isfinite(value)])
    if numbers.size == 0:
        nan = float("nan")
        return Spread(nan, nan, nan, nan, nan, nan, 0)
    p5, median, p95 = np.percentile(numbers, [5, 50, 95])
    least, most = float(numbers.min()), float(numbers.max())
    return Spread(float(median), float(numbers.mean()), float(p5), float(p95), least, most, int(numbers.size))
