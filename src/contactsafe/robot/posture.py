"""The posture that goes with a tool pose: a function of the pose alone, whatever path led there.

Of all joint positions that put the tool at a pose, the one nearest home is taken; docs/concepts/posture.md derives it
and says where that is continuous. Newton's method on the Lagrangian, from starts that know nothing but the pose.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsafe.core.arrays import Matrix, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import cross_into, dot
from contactsafe.core.rotation import matrix_to_quat, matrix_to_quat_into
from contactsafe.core.stack import stack_matrix, stack_vector
from contactsafe.robot.arm import Arm, Pose, finite_range
from contactsafe.robot.chain import Chain, chain_kinematics, chain_of
from contactsafe.robot.posture_step import newton_step

POSITION_TOLERANCE = 1e-4
"""A pose counts as reached within this, m."""

ROTATION_TOLERANCE = math.radians(0.01)
"""A pose counts as reached within this, rad."""

_BARRIER = 0.1  # weight of the distance from the joint limits against that from home, rad²
_OTHER_STARTS = 256  # postures of which the nearest are started from where home does not lead to the pose
_TRIES = 2  # of them
_ITERATIONS = 40  # of one start at most
_PATIENCE = 3  # iterations with less than a fifth of the progress wanted after which a start is given up
_STRIDE_M, _STRIDE_RAD = 0.06, 0.2  # by which one iteration moves the tool at most: the path from home is followed
_STEP = 0.3  # rad, by which one iteration moves a joint at most
_ROOM = 0.8  # fraction of the distance to a joint limit that one iteration may move
_CONVERGED = 1e-6  # rad; Newton's method squares what is left, so the posture is exact to about 1e-11
_INSIDE = 0.01  # a start is at least this fraction of the range away from a joint limit
_NARROW = 1e-6  # rad; a joint of less range stays where home has it
_ON_AXIS = 0.01  # m; nearer to the first axis, home has no azimuth


class PostureRule(NamedTuple):
    """All that `find_posture` needs to know of an arm.

    Attributes:
        chain: its kinematics.
        low, high: joint range, (n,), rad; ±inf where a joint turns without end.
        home: the posture that others are to be near, (n,), rad.
        azimuth: of the tool at home, as a vector in the plane that the first axis is normal to, (3,); 0 on the axis.
        starts: other postures to start from, (m, n), rad.
        start_positions: of the tool in them, (m, 3), m.
        start_quats: of the tool in them, (m, 4).
        reach: no pose puts the last axis further from the first than this, (1,), m.
        last_axis: point on the last joint's axis in the tool's frame, (3,), m.
    """

    chain: Chain
    low: np.ndarray
    high: np.ndarray
    home: np.ndarray
    azimuth: np.ndarray
    starts: np.ndarray
    start_positions: np.ndarray
    start_quats: np.ndarray
    reach: np.ndarray
    last_axis: np.ndarray


def posture_rule(arm: Arm) -> PostureRule:
    """Set up the rule for an arm: nearness to `arm.home`, within its joint range."""
    chain = chain_of(arm)
    low, high = finite_range(arm.q_min, arm.q_max)
    inside = _INSIDE * (high - low)
    home = np.clip(arm.home, arm.q_min + inside, arm.q_max - inside)
    starts = np.random.default_rng(0).uniform(low + inside, high - inside, (_OTHER_STARTS, arm.n))
    poses = [_tool_pose(chain, q) for q in (home, *starts)]
    azimuth = _off_axis(chain, poses[0].position)
    return PostureRule(
        chain=chain,
        low=arm.q_min.copy(),
        high=arm.q_max.copy(),
        home=home,
        azimuth=azimuth if np.linalg.norm(azimuth) > _ON_AXIS else np.zeros(3),
        starts=starts,
        start_positions=np.array([pose.position for pose in poses[1:]]),
        start_quats=np.array([pose.quat for pose in poses[1:]]),
        reach=np.array([np.linalg.norm(np.diff(chain.anchors, axis=0), axis=1).sum() + 1e-6]),
        last_axis=chain.frame.T @ (chain.anchors[-1] - chain.tool),
    )


def _tool_pose(chain: Chain, q: np.ndarray) -> Pose:
    position, rotation, J = np.empty(3), np.empty((3, 3)), np.empty((6, len(q)))
    chain_kinematics(chain, q, position, rotation, J)
    return Pose(position, matrix_to_quat(rotation))


def _off_axis(chain: Chain, point: np.ndarray) -> np.ndarray:
    """Return the part of a point, (3,), m, that is off the first joint's axis."""
    away = point - chain.anchors[0]
    return away - (away @ chain.axes[0]) * chain.axes[0]


@compiled(nogil=True)
def find_posture(rule: PostureRule, position: Vector, quat: Vector, q_out: Vector) -> tuple[float, float]:
    """Find the posture of a tool pose: of those that reach it the one nearest home, W least.

    W(q) = Σ ½ (q − q_home)² + b (h ln(h/t) + (1 − h) ln((1 − h)/(1 − t))), where t is how far through its range a joint
    is, 0 … 1, h the same of home, and b = 0.1 rad²: the distance from home, and a barrier that is 0 at home, too, and
    infinite at the joint limits (none where a joint turns without end). It is strictly convex.

    Its minimum on the pose is followed from home's pose to the one asked for: home, turned about the first axis to
    where the pose is, then straight on. Where that ends at a limit or at a fold, the nearest of other fixed
    postures are started from. Nothing is remembered between calls.

    Args:
        rule: of the arm, `PostureRule`.
        position: of the tool, world, (3,), m.
        quat: of the tool, world, unit w x y z, (4,).
        q_out: receives the joint positions, (n,), rad, within the limits; home where the pose is not reached.

    Returns:
        Position error in m and rotation error in rad that are left: within `POSITION_TOLERANCE` and
        `ROTATION_TOLERANCE` where the pose is reached, inf where it is further away than the links are long or not
        finite.
    """
    q_out[:] = rule.home
    if not _may_be_reached(rule, position, quat):
        return math.inf, math.inf
    turn_towards(rule, position, q_out)
    position_error, rotation_error, reached = _follow(rule, position, quat, q_out)
    if not reached:
        position_error, rotation_error, reached = _try_others(rule, position, quat, q_out)
    if not reached:
        q_out[:] = rule.home
    return position_error, rotation_error


@compiled
def _try_others(rule: PostureRule, position: Vector, quat: Vector, q: Vector) -> tuple[float, float, bool]:
    """Start from the fixed postures that put the tool nearest to the pose; returns what `_follow` does."""
    away = stack_vector(rule.starts.shape[0])
    for k in range(away.shape[0]):
        square, cosine = 0.0, 0.0
        for a in range(3):
            square += (position[a] - rule.start_positions[k, a]) ** 2
        for a in range(4):
            cosine += quat[a] * rule.start_quats[k, a]
        away[k] = math.sqrt(square) / _STRIDE_M + math.sqrt(max(8.0 - 8.0 * abs(cosine), 0.0)) / _STRIDE_RAD
    position_error, rotation_error, reached = math.inf, math.inf, False
    for _ in range(_TRIES):
        nearest = 0
        for k in range(away.shape[0]):
            if away[k] < away[nearest]:
                nearest = k
        away[nearest] = math.inf
        q[:] = rule.starts[nearest]
        position_error, rotation_error, reached = _follow(rule, position, quat, q)
        if reached:
            break
    return position_error, rotation_error, reached


@compiled
def _may_be_reached(rule: PostureRule, position: Vector, quat: Vector) -> bool:
    """Tell whether the pose puts the last joint's axis within the length of the links before it."""
    twice, across = stack_vector(3), stack_vector(3)
    cross_into(quat[1:], rule.last_axis, twice)
    for a in range(3):
        twice[a] *= 2.0
    cross_into(quat[1:], twice, across)
    square = 0.0
    for a in range(3):
        turned = rule.last_axis[a] + quat[0] * twice[a] + across[a]
        square += (position[a] + turned - rule.chain.anchors[0, a]) ** 2
    return square <= rule.reach[0] * rule.reach[0]


@compiled
def turn_towards(rule: PostureRule, position: Vector, q: Vector) -> None:
    """Turn the first joint by the pose's azimuth less home's, as far as its range goes."""
    axis, away = rule.chain.axes[0], stack_vector(3)
    for a in range(3):
        away[a] = position[a] - rule.chain.anchors[0, a]
    x, y, z = rule.azimuth[0], rule.azimuth[1], rule.azimuth[2]
    side = (
        axis[0] * (y * away[2] - z * away[1])
        + axis[1] * (z * away[0] - x * away[2])
        + axis[2] * (x * away[1] - y * away[0])
    )
    turned = q[0] + math.atan2(side, x * away[0] + y * away[1] + z * away[2])
    inside = 0.0
    if rule.high[0] - rule.low[0] < math.inf:
        inside = _INSIDE * (rule.high[0] - rule.low[0])
    q[0] = min(max(turned, rule.low[0] + inside), rule.high[0] - inside)


@compiled
def _follow(rule: PostureRule, position: Vector, quat: Vector, q: Vector) -> tuple[float, float, bool]:
    """Follow the minimum from q to a pose.

    Returns:
        Position error in m, rotation error in rad, and whether the pose was reached.
    """
    n = q.shape[0]
    found, rotation, J = stack_vector(3), stack_matrix(3, 3), stack_matrix(6, n)
    error, slope, scale, step = stack_vector(6), stack_vector(n), stack_vector(n), stack_vector(n)
    position_error, rotation_error, best, stalled = math.inf, math.inf, math.inf, 0
    for iteration in range(_ITERATIONS + 1):
        chain_kinematics(rule.chain, q, found, rotation, J)
        position_error, rotation_error = _pose_error(position, quat, found, rotation, error)
        strides = max(position_error / _STRIDE_M, rotation_error / _STRIDE_RAD)
        stalled = stalled + 1 if strides > best - 0.2 * min(best, 1.0) and strides > 1e-3 else 0
        if iteration == _ITERATIONS or stalled > _PATIENCE or not strides < math.inf:
            break
        best = min(best, strides)
        for a in range(6):
            error[a] /= max(strides, 1.0)
        _cost(rule, q, slope, scale)
        newton_step(J, error, slope, scale, step)
        largest, whole = _within_room(rule, q, step)
        for i in range(n):
            q[i] += step[i]
        if strides < 1.0 and whole and largest < _CONVERGED:
            return position_error, rotation_error, True
    return position_error, rotation_error, position_error <= POSITION_TOLERANCE and rotation_error <= ROTATION_TOLERANCE


@compiled
def _pose_error(position: Vector, quat: Vector, found: Vector, rotation: Matrix, error: Vector) -> tuple[float, float]:
    """Fill target less found, position and rotation vector, world axes, (6,); return their lengths in m and rad."""
    q = matrix_to_quat_into(rotation, stack_vector(4))
    w = quat[0] * q[0] + quat[1] * q[1] + quat[2] * q[2] + quat[3] * q[3]
    error[3] = -quat[0] * q[1] + quat[1] * q[0] - quat[2] * q[3] + quat[3] * q[2]
    error[4] = -quat[0] * q[2] + quat[1] * q[3] + quat[2] * q[0] - quat[3] * q[1]
    error[5] = -quat[0] * q[3] - quat[1] * q[2] + quat[2] * q[1] + quat[3] * q[0]
    sine = math.sqrt(dot(error[3:], error[3:]))
    angle = 2.0 * math.atan2(sine, abs(w))
    scale = math.copysign(angle / sine if sine > 1e-12 else 2.0, w)
    for a in range(3):
        error[a] = position[a] - found[a]
        error[3 + a] *= scale
    return math.sqrt(dot(error[:3], error[:3])), angle


@compiled
def _cost(rule: PostureRule, q: Vector, slope: Vector, scale: Vector) -> None:
    """Fill W' of `find_posture` and 1/√W'', joint by joint, (n,)."""
    for i in range(q.shape[0]):
        span = rule.high[i] - rule.low[i]
        if span < _NARROW:
            slope[i], scale[i] = 0.0, 0.0
        elif span < math.inf:
            t, h = (q[i] - rule.low[i]) / span, (rule.home[i] - rule.low[i]) / span
            barrier = h / (t * t) + (1.0 - h) / ((1.0 - t) * (1.0 - t))
            slope[i] = q[i] - rule.home[i] + _BARRIER * (t - h) / (span * t * (1.0 - t))
            scale[i] = 1.0 / math.sqrt(1.0 + _BARRIER * barrier / (span * span))
        else:
            slope[i], scale[i] = q[i] - rule.home[i], 1.0


@compiled
def _within_room(rule: PostureRule, q: Vector, step: Vector) -> tuple[float, bool]:
    """Shorten a step in place so that every joint stays within its range.

    Returns:
        The largest part of it as it was, rad, and whether it is whole.
    """
    largest, fraction = 0.0, 1.0
    for i in range(q.shape[0]):
        size = abs(step[i])
        room = rule.high[i] - q[i] if step[i] > 0.0 else q[i] - rule.low[i]
        if size * fraction > _ROOM * room:
            fraction = _ROOM * room / size
        if size * fraction > _STEP:
            fraction = _STEP / size
        largest = max(largest, size)
    for i in range(q.shape[0]):
        step[i] *= fraction
    return largest, fraction == 1.0
