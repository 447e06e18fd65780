"""What a policy asks for that means no good."""

import numpy as np

from contactsafe import Pose, Target


def fuzzed_target(arm, rng):
    """Draw a target that has nothing to do with where the arm is: pose, gains within their ranges, posture."""
    quat = rng.normal(size=4)
    pose = Pose(rng.uniform([0.2, -0.6, 0.0], [0.7, 0.6, 0.8]), quat / np.linalg.norm(quat))
    return Target(pose, rng.uniform(10, 1500, 6), rng.uniform(2, 120, 6), rng.uniform(arm.q_min, arm.q_max))


def corner_target(arm, rng, stiffness, damping):
    """Draw a target at a corner of the joint range, every joint at one of its limits."""
    corner = np.where(rng.random(arm.n) < 0.5, arm.q_min, arm.q_max)
    return Target(arm.tool_pose(corner), np.full(6, stiffness), np.full(6, damping), corner)


def disturb(k, every, arm, plant, rng, target):
    """Give the target in force at tick k, a new fuzzed one every so many ticks; push another link every 500."""
    if k % 500 == 0:
        plant.data.xfrc_applied[:] = 0.0
        plant.push(f"link{rng.integers(3, 8)}", rng.normal(size=3) * 15.0)
    return fuzzed_target(arm, rng) if k % every == 0 else target
