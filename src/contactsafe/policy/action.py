"""From an action to the controller's target, compiled: increments of x_d, K1 and D1, then its posture."""

import numpy as np

from contactsafe.core.arrays import Matrix, Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.rotation import matrix_to_quat, quat_multiply, quat_to_rotvec, rotvec_to_quat
from contactsafe.policy.action_config import ActionLimits
from contactsafe.robot.posture import POSITION_TOLERANCE, ROTATION_TOLERANCE, PostureRule, find_posture

DOWN = np.array([0.0, 1.0, 0.0, 0.0])
"""Orientation of a tool that points straight down, w x y z."""

_UNDO_DOWN = np.array([0.0, -1.0, 0.0, 0.0])


@compiled
def rotation_from_down(quat: Vector) -> Vector:
    """Return the rotation vector, world axes, that turns straight down into an orientation, (3,), rad."""
    return quat_to_rotvec(quat_multiply(quat, _UNDO_DOWN))


@compiled(nogil=True)
def apply_action(c: Record, limits: ActionLimits, rule: PostureRule, action: Vector) -> None:
    """Move the target of a `controller_dtype` record by one action.

    x_d is never farther from the tool than `offset_max`, nor outside its bounds; the posture is the one
    that goes with x_d, whatever path led there, and stays where it was when there is none.

    Args:
        c: the controller; its `output.position` is where the tool was measured last.
        limits: `ActionLimits`.
        rule: the arm's `PostureRule`.
        action: (18,); clipped to [−1, 1].
    """
    target = c.target
    rotvec = rotation_from_down(target.quat)
    for i in range(6):
        a = min(max(action[i], -1.0), 1.0) * limits.step[i]
        if i < 3:
            target.position[i] = min(max(target.position[i] + a, limits.low[i]), limits.high[i])
        else:
            rotvec[i - 3] = min(max(rotvec[i - 3] + a, limits.low[i]), limits.high[i])
        K = target.K_task[i] + min(max(action[6 + i], -1.0), 1.0) * limits.step[6 + i]
        D = target.D_task[i] + min(max(action[12 + i], -1.0), 1.0) * limits.step[12 + i]
        target.K_task[i] = min(max(K, limits.K_low[i]), limits.K_high[i])
        target.D_task[i] = min(max(D, limits.D_low[i]), limits.D_high[i])
    for i in range(3):
        tool, offset_max = c.output.position[i], limits.offset_max[i]
        target.position[i] = min(max(target.position[i], tool - offset_max), tool + offset_max)
    target.quat[:] = quat_multiply(rotvec_to_quat(rotvec), DOWN)
    q_posture = np.empty(target.q_posture.shape[0])
    error, rotation_error = find_posture(rule, target.position, target.quat, q_posture)
    if error <= POSITION_TOLERANCE and rotation_error <= ROTATION_TOLERANCE:
        target.q_posture[:] = q_posture


@compiled
def observed_pose(c: Record, out: Vector) -> None:
    """Fill tool position, m, and rotation vector from straight down, rad, as measured, (6,)."""
    rotvec = rotation_from_down(matrix_to_quat(c.output.rotation))
    for i in range(3):
        out[i] = c.output.position[i]
        out[3 + i] = rotvec[i]


@compiled
def observed_target(c: Record, pose: Vector, out: Vector) -> None:
    """Fill x_d less the observed pose, m and rad, then K1, 1/s², and D1, 1/s, (18,)."""
    rotvec = rotation_from_down(c.target.quat)
    for i in range(3):
        out[i] = c.target.position[i] - pose[i]
        out[3 + i] = rotvec[i] - pose[3 + i]
    out[6:12] = c.target.K_task
    out[12:18] = c.target.D_task


@compiled(nogil=True)
def act(
    start: int, stop: int, controllers: np.ndarray, limits: ActionLimits, rule: PostureRule, actions: Matrix
) -> None:
    """Move the targets of the controllers from start to stop by their actions; see `apply_action`."""
    for i in range(start, stop):
        apply_action(controllers[i], limits, rule, actions[i])


@compiled(nogil=True)
def apply_one(controllers: np.ndarray, i: int, limits: ActionLimits, rule: PostureRule, action: Vector) -> None:
    """Run `apply_action` on one of an array of records."""
    apply_action(controllers[i], limits, rule, action)


@compiled(nogil=True)
def look_at(controllers: np.ndarray, i: int, pose: Vector, target: Vector) -> None:
    """Run `observed_pose`, (6,), and `observed_target`, (18,), on one of an array of records."""
    observed_pose(controllers[i], pose)
    observed_target(controllers[i], pose, target)
