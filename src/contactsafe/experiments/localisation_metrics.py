"""What is measured of an estimated place: how far from the true one, with what force, and whether its set holds it."""

import math
from collections.abc import Sequence

import numpy as np

from contactsafe.experiments.touch_limit import Belief
from contactsafe.results.metrics import Aim, Metric

SET = 0.95
"""Probability of the set of places."""

FORCE_FRACTION, FORCE_N = 0.15, 2.0
"""A force is right within the larger of these: part of the true one, and N."""

NEAREST = ("point_error_cm", "within_5_cm", "link_right", "in_set")
"""Figures of two contacts: of the nearest of them, or of either. Their names begin with nearest_."""

METRICS = (
    Metric("felt", "contacts felt, mean", "%", 100.0, mean=True),
    Metric("felt_early", "felt before anything touched, mean", "%", 100.0, mean=True),
    Metric("point_error_cm", "best point, from the true one", "cm"),
    Metric(
        "within_5_cm", "best point within 5 cm, mean", "%", 100.0, main=True, aim=Aim(at_least=70.0), mean=True
    ),
    Metric(
        "within_5_cm_moved", "best point within 5 cm, mean", "%", 100.0, main=True, aim=Aim(at_least=85.0), mean=True
    ),
    Metric("link_right", "link right, mean", "%", 100.0, mean=True),
    Metric("tool_named", "taken for the tool's, mean", "%", 100.0, mean=True),
    Metric("in_set", "true point in the 95 % set, mean", "%", 100.0, main=True, aim=Aim(at_least=95.0), mean=True),
    Metric("set_places", "places in the set"),
    Metric("set_area_cm2", "area of the set", "cm²"),
    Metric("force_error_n", "force, from the true one", "N"),
    Metric("force_error_deg", "angle between the two", "°"),
    Metric(
        "force_within", "force within 15 % or 2 N, mean", "%", 100.0, main=True, aim=Aim(at_least=80.0), mean=True
    ),
    Metric("force_size_within", "its size alone within that, mean", "%", 100.0, mean=True),
    Metric("nearest_point_error_cm", "best point, from the nearest true one", "cm", main=True),
    Metric("nearest_within_5_cm", "best point within 5 cm of it, mean", "%", 100.0, main=True, mean=True),
    Metric("nearest_link_right", "link either of the two, mean", "%", 100.0, mean=True),
    Metric("told", "told that no single contact explains it, mean", "%", 100.0, mean=True),
    Metric("nearest_in_set", "either true point in the 95 % set, mean", "%", 100.0, main=True, mean=True),
)  # fmt: skip


def point_metrics(best: np.ndarray, link: int, true: Sequence[tuple[int, np.ndarray]]) -> dict[str, float]:
    """Compare a best point with the nearest of the true ones.

    Args:
        best: world, (3,), m.
        link: that was named, n + 1 for the tool.
        true: links and points that are touched, world, (3,), m.
    """
    error = min(float(np.linalg.norm(best - point)) for _, point in true)
    return {
        "point_error_cm": 100.0 * error,
        "within_5_cm": float(error < 0.05),
        "link_right": float(any(link == touched for touched, _ in true)),
    }


def set_metrics(
    links: np.ndarray, points: np.ndarray, apart: float, true: Sequence[tuple[int, np.ndarray]]
) -> dict[str, float]:
    """Tell whether a set of places holds any of the true points, and how large it is.

    Args:
        links: of the places, n + 1 for the tool, (K,).
        points: world, (K, 3), m.
        apart: spacing of the places, m.
        true: links and points that are touched.
    """
    held = any(bool((np.linalg.norm(points[links == link] - point, axis=1) <= apart).any()) for link, point in true)
    return {"in_set": float(held), "set_places": float(len(links)), "set_area_cm2": 1e4 * apart**2 * len(links)}


def force_metrics(force: np.ndarray, true: np.ndarray) -> dict[str, float]:
    """Compare a force with the true one, both world, (3,), N."""
    size, true_size = float(np.linalg.norm(force)), float(np.linalg.norm(true))
    error, allowed = float(np.linalg.norm(force - true)), max(FORCE_FRACTION * true_size, FORCE_N)
    cosine = float(force @ true) / max(size * true_size, 1e-12)
    return {
        "force_error_n": error,
        "force_error_deg": math.degrees(math.acos(min(max(cosine, -1.0), 1.0))),
        "force_within": float(error <= allowed),
        "force_size_within": float(abs(size - true_size) <= allowed),
    }


def limit_metrics(
    known: Belief, force: np.ndarray, apart: float, true: tuple[int, np.ndarray], true_force: np.ndarray
) -> dict[str, float]:
    """Return the same figures of the posterior that the torques themselves allow, under names that begin with limit_.

    Args:
        known: the posterior.
        force: estimated where the place is known, world, (3,), N.
        apart: how far the points are apart, m.
        true: link and point that is touched.
        true_force: world, (3,), N.
    """
    link, best = known.best()
    likeliest = known.likeliest(SET)
    figures = point_metrics(best, link, [true])
    figures |= set_metrics(known.links[likeliest], known.points[likeliest], apart, [true])
    figures |= force_metrics(force, true_force)
    return {f"limit_{name}": value for name, value in figures.items()}
