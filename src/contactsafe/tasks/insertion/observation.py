"""What the insertion task lets its policies observe, and at which scale."""

from contactsafe.policy.observation import Observation

OFFSET = Observation(
    "offset",
    centre=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    scale=(0.005, 0.005, 0.01, 0.03, 0.03, 0.03),
    unit="m, rad",
    doc="tool position less the believed mouth, and rotation vector from straight down",
)

FORCE = Observation(
    "force",
    centre=(0.0, 0.0, 5.0),
    scale=(5.0, 5.0, 5.0),
    unit="N",
    doc="on the peg as the wrist measures it, smoothed, world axes",
)

TORQUE = Observation(
    "torque",
    centre=(0.0, 0.0, 0.0),
    scale=(0.2, 0.2, 0.2),  # 10 N at the edge of the peg, twice
    unit="N m",
    doc="about the peg's tip as the wrist measures it, world axes",
)
