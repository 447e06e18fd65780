"""What a task reports of an episode, and the figures of an evaluation over many: each task declares its own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class EpisodeMetric:
    """A number of an episode, read from `info` at its last step; an environment lists its own as `episode_metrics`.

    Attributes:
        name: in records and logs.
        key: in `info`.
        convert: from what `info` holds to what is recorded.
    """

    name: str
    key: str
    convert: Callable[[float], float | bool] = float


@dataclass(frozen=True)
class Episodes:
    """Episodes that were run, as figures are computed from them.

    Attributes:
        records: a dict per episode: success, time_s, peak_force_n, return, and the task's metrics.
        contact_forces: largest tool force of each policy step in contact, N.
        steps: policy steps in all.
    """

    records: list[dict]
    contact_forces: np.ndarray
    steps: int

    def of(self, name: str) -> np.ndarray:
        """Return one entry of all records, (n,)."""
        return np.array([record[name] for record in self.records])


@dataclass(frozen=True)
class Figure:
    """A figure of an evaluation; an environment lists its own as `figures`, in the order in which they are shown.

    Attributes:
        name: in results.
        doc: what it means.
        compute: from Episodes to a number; NaN where there is none.
    """

    name: str
    doc: str
    compute: Callable[[Episodes], float]


def mean(name: str) -> Callable[[Episodes], float]:
    """Compute the mean of an entry of the records."""
    return lambda episodes: float(episodes.of(name).mean())


def median(name: str) -> Callable[[Episodes], float]:
    """Compute the median of an entry of the records."""
    return lambda episodes: float(np.median(episodes.of(name)))


def quantile(name: str, q: float) -> Callable[[Episodes], float]:
    """Compute a quantile of an entry of the records."""
    return lambda episodes: float(np.quantile(episodes.of(name), q))


def largest(name: str) -> Callable[[Episodes], float]:
    """Compute the largest of an entry of the records."""
    return lambda episodes: float(episodes.of(name).max())


def total(name: str) -> Callable[[Episodes], int]:
    """Compute the sum of an entry of the records: in how many episodes something was so."""
    return lambda episodes: int(np.sum(episodes.of(name)))


def count(episodes: Episodes) -> int:
    """Return the number of episodes."""
    return len(episodes.records)


def median_time_to_success(episodes: Episodes) -> float:
    """Compute the median length of the episodes that succeeded, s; NaN where none did."""
    success = episodes.of("success").astype(bool)
    return float(np.median(episodes.of("time_s")[success])) if success.any() else float("nan")


def median_contact_force(episodes: Episodes) -> float:
    """Compute the median force in contact, N; 0 where there was none."""
    return float(np.median(episodes.contact_forces)) if len(episodes.contact_forces) else 0.0


def contact_fraction(episodes: Episodes) -> float:
    """Compute the fraction of policy steps in contact."""
    return float(len(episodes.contact_forces) / episodes.steps)


SUCCESS = (
    Figure("episodes", "episodes run", count),
    Figure("success", "fraction of episodes that succeeded", mean("success")),
)

FORCES = (
    Figure("peak_force_median_n", "largest force on the tool in an episode, N: median", median("peak_force_n")),
    Figure("peak_force_p95_n", "the same: 95th percentile", quantile("peak_force_n", 0.95)),
    Figure("peak_force_max_n", "the same: largest of all", largest("peak_force_n")),
    Figure(
        "contact_force_median_n",
        "force on the tool, N, the largest of each policy step in contact: median",
        median_contact_force,
    ),
)

RETURN = (Figure("return_mean", "sum of an episode's rewards: mean", mean("return")),)

FIGURES = (
    *SUCCESS,
    Figure("time_mean_s", "length of an episode, s: mean", mean("time_s")),
    Figure("time_to_success_median_s", "the same, of those that succeeded alone: median", median_time_to_success),
    *FORCES,
    Figure("contact_fraction", "fraction of all policy steps in which the tool was in contact", contact_fraction),
    *RETURN,
)
"""Figures of a task that declares none of its own."""


def names(figures: tuple[Figure, ...]) -> Mapping[str, str]:
    """Return what each figure means, by name."""
    return {figure.name: figure.doc for figure in figures}
