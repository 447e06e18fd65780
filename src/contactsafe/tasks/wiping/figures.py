"""What the wiping task reports of an episode, and the figures of its evaluation."""

from contactsafe.tasks.base.figures import (
    FORCES,
    RETURN,
    EpisodeMetric,
    Episodes,
    Figure,
    contact_fraction,
    count,
    mean,
    median,
    median_time_to_success,
    quantile,
    total,
)


def _removed(ink_left: float) -> float:
    return float(1.0 - ink_left)


def _cleared_99(episodes: Episodes) -> float:
    return float((episodes.of("ink_removed") >= 0.99).mean())


EPISODE_METRICS = (
    EpisodeMetric("ink_removed", "ink_left", _removed),
    EpisodeMetric("arm_touched", "arm_touched", bool),
)
"""Ink removed, as a fraction; whether anything but the pad met board or table."""

FIGURES = (
    Figure("episodes", "boards wiped, one episode each", count),
    Figure(
        "success",
        "fraction of boards wiped clean (99.8 % of the ink gone, unless told otherwise), which ends the episode",
        mean("success"),
    ),
    Figure("cleared_99", "fraction of boards with 99 % of their ink gone within the time limit", _cleared_99),
    Figure("ink_removed_mean", "fraction of a board's ink that was wiped off: mean", mean("ink_removed")),
    Figure("ink_removed_median", "the same: median", median("ink_removed")),
    Figure("ink_removed_p10", "the same: 10th percentile", quantile("ink_removed", 0.1)),
    Figure(
        "time_mean_s",
        "length of an episode, s: mean; 20 s where nothing ended it before, such as a clean board",
        mean("time_s"),
    ),
    Figure("time_to_success_median_s", "the same, of the boards wiped clean alone: median", median_time_to_success),
    *FORCES,
    Figure(
        "arm_contacts", "episodes ended because something other than the pad met board or table", total("arm_touched")
    ),
    Figure(
        "contact_fraction",
        "fraction of all policy steps in which the tool was in contact; the rest goes from patch to patch",
        contact_fraction,
    ),
    *RETURN,
)
"""In the order in which they are shown; forces are the simulator's."""
