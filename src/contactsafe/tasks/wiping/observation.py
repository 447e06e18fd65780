"""What the wiping task lets its policies observe besides the mask, and at which scale."""

from contactsafe.policy.action_config import ActionConfig
from contactsafe.policy.observation import Observation, target_observation

POSE = Observation(
    "pose",
    # Middle of the board and half the ink area, a hand's breadth of height, m; rad.
    centre=(0.5, 0.0, 0.01, 0.0, 0.0, 0.0),
    scale=(0.15, 0.15, 0.03, 0.1, 0.1, 0.1),
    unit="m, rad",
    doc="tool position and rotation vector from straight down",
)

FORCE = Observation(
    "force",
    centre=(0.0, 0.0, 0.0),
    scale=(5.0, 5.0, 5.0),  # what gentle wiping presses with
    unit="N",
    doc="of the board on the tool as the wrist measures it, smoothed, world axes",
)


def observation_vectors(action: ActionConfig) -> tuple[Observation, ...]:
    """Return the vectors, in the order of the observation."""
    return POSE, target_observation(action), FORCE
