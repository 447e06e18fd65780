"""Which recorded curves are plotted, declared beside the experiment that recorded them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contactsafe.results.recording import Recording

Curve = Callable[[Recording], np.ndarray]
"""From a recording to one value a tick, (T,)."""


@dataclass(frozen=True)
class Panel:
    """One pair of axes over time.

    Attributes:
        label: of what is plotted.
        unit: of it.
        curve: what is plotted, in that unit.
        noisy: plot the mean as a line and the range as a pale band.
    """

    label: str
    unit: str
    curve: Curve
    noisy: bool = False

    @property
    def title(self) -> str:
        """The label with its unit."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


@dataclass(frozen=True)
class Figure:
    """Plots of every recorded scenario with one caption.

    Attributes:
        plots: each of panels under each other.
        caption: what is seen, in a sentence or two.
        columns: of plots, 2 or 3.
        shaded: true while a plot's ground is to be shaded, one value a tick, (T,).
        one_controller: show the last controller alone.
        of_a_log: what is plotted was recorded once, and has no seed.
    """

    plots: tuple[tuple[Panel, ...], ...]
    caption: str
    columns: int = 2
    shaded: Curve | None = None
    one_controller: bool = False
    of_a_log: bool = False


def component(field: str, index: int, scale: float = 1.0) -> Curve:
    """Return the curve of one component of a vector in the trace, times a scale."""
    return lambda run: scale * run.trace[field][:, index]


def scalar(field: str) -> Curve:
    """Return the curve of a scalar in the trace."""
    return lambda run: run.trace[field]


def largest(field: str) -> Curve:
    """Return the curve of a vector's largest component, without its sign."""
    return lambda run: np.abs(run.trace[field]).max(axis=1)


def length(field: str, scale: float = 1.0) -> Curve:
    """Return the curve of a length: of a vector in the trace, (T, 3), or the position part of a pose's, (T, 6)."""
    return lambda run: scale * np.linalg.norm(run.trace[field][:, :3], axis=1)
