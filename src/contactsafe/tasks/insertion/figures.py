"""What the insertion task reports of an episode, and the figures of its evaluation."""

from contactsafe.tasks.base.figures import (
    FORCES,
    RETURN,
    SUCCESS,
    EpisodeMetric,
    Figure,
    median,
    median_time_to_success,
    total,
)

EPISODE_METRICS = (EpisodeMetric("depth_m", "depth_m"), EpisodeMetric("arm_touched", "arm_touched", bool))
"""How deep the peg is at the end, m; whether anything but the peg met block or table."""

FIGURES = (
    *SUCCESS,
    Figure("time_to_success_median_s", "time to full depth, s: median of the successful", median_time_to_success),
    Figure("depth_median_m", "depth of the peg in the hole at the end, m: median", median("depth_m")),
    *FORCES,
    Figure(
        "arm_contacts", "episodes ended because something other than the peg met block or table", total("arm_touched")
    ),
    *RETURN,
)
"""In the order in which they are shown; forces are the simulator's."""
