"""What the insertion task lets its policies observe, and at which scale."""

from contactsafe.policy.observation import Observation

OFFSET = Observation(
    "offset",
    centre=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    scale=(0.005, 0.005, 0.01, 0.03, 0.03, 0.03),
    unit="m, rad",
    doc="tool position less the believed mouth, and rotation vector from straight down",
)

WRENCH = Observation(
    "wrench",
    centre=(0.0, 0.0, 5.0, 0.0, 0.0, 0.0),
    scale=(3.0, 3.0, 5.0, 0.05, 0.05, 0.05),  # 5 N at the edge of the peg
    unit="N, N m",
    doc="on the peg, about its tip, as the wrist measures it, less its bias, smoothed, world axes",
)

ELAPSED = Observation("elapsed", centre=(5.0,), scale=(5.0,), unit="s", doc="time since the episode began")
