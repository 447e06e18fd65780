"""The posture that goes with a tool pose: a function of the pose alone, whatever way led there.

Of all joint positions that put the tool at a pose, the one nearest home is taken; docs/concepts/posture.md derives it
and says where that is continuous. Newton's method on the Lagrangian, from starts that know nothing but the pose.
"""

import math
from typing import NamedTuple

import numpy as np

from contactsafe.core.compiled import compiled
from contactsafe.core.linalg import cross_into, dot, spd_inverse
from contactsafe.core.rotation import matrix_to_quat, matrix_to_quat_into
from contactsafe.core.stack import stack_matrix, stack_vector
from contactsafe.robot.arm import Arm, Pose, finite_range
from contactsafe.robot.chain import Chain, chain_kinematics, chain_of

POSITION_TOLERANCE = 1e-4
"""A pose counts as reached within this, m."""

ROTATION_TOLERANCE = math.radians(0.01)
"""A pose counts as reached within this, rad."""

_BARRIER = 0.1  # weight of the distance from the joint limits against that from home, rad²
_OTHER_STARTS = 256  # postures of which the nearest are started from where home does not lead to the pose
_TRIES = 2  # of them
_ITERATIONS = 40  # of one start at most
_PATIENCE = 3  # iterations with less than a fifth of the progress wanted after which a start is given up
_WAY_M, _WAY_RAD = 0.06, 0.2  # by which one iteration moves the tool at most: the way from home is followed, not jumped
_STEP = 0.3  # rad, by which one iteration moves a joint at most
_ROOM = 0.8  # share of the way to a joint limit that one iteration may go
_CONVERGED = 1e-6  # rad; Newton's method squares what is left, so the posture is exact to about 1e-11
_LOST = 1e-3  # a task direction of less is as good as lost, m or rad per unit of the cost's root
_INSIDE = 0.01  # a start is at least this share of the range away from a joint limit
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
    """Give the part of a point, (3,), m, that is off the first joint's axis."""
    away = point - chain.anchors[0]
    return away - (away @ chain.axes[0]) * chain.axes[0]


@compiled(nogil=True)
def find_posture(rule, position, quat, q_out):
    """Find the posture of a tool pose: of those that reach it the one nearest home, W least.

    W(q) = Σ ½ (q − q_home)² + b (h ln(h/t) + (1 − h) ln((1 − h)/(1 − t))), where t is how far through its range a joint
    is, 0 … 1, h the same of home, and b = 0.1 rad²: the distance from home, and a barrier that is 0 at home, too, and
    infinite at the joint limits (none where a joint turns without end). It is strictly convex.

    Its minimum on the pose is followed from home's pose to the one asked for: home, turned about the first axis to
    where the pose is, then the straight way. Where that ends at a limit or at a fold, the nearest of other fixed
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
    _turn_towards(rule, position, q_out)
    position_error, rotation_error, reached = _follow(rule, position, quat, q_out)
    if not reached:
        position_error, rotation_error, reached = _try_others(rule, position, quat, q_out)
    if not reached:
        q_out[:] = rule.home
    return position_error, rotation_error


@compiled
def _try_others(rule, position, quat, q):
    """Start from the fixed postures that put the tool nearest to the pose; returns what `_follow` does."""
    away = stack_vector(rule.starts.shape[0])
    for k in range(away.shape[0]):
        square, cosine = 0.0, 0.0
        for a in range(3):
            square += (position[a] - rule.start_positions[k, a]) ** 2
        for a in range(4):
            cosine += quat[a] * rule.start_quats[k, a]
        away[k] = math.sqrt(square) / _WAY_M + math.sqrt(max(8.0 - 8.0 * abs(cosine), 0.0)) / _WAY_RAD
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
def _may_be_reached(rule, position, quat):
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
def _turn_towards(rule, position, q):
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
def _follow(rule, position, quat, q):
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
        way = max(position_error / _WAY_M, rotation_error / _WAY_RAD)
        stalled = stalled + 1 if way > best - 0.2 * min(best, 1.0) and way > 1e-3 else 0
        if iteration == _ITERATIONS or stalled > _PATIENCE or not way < math.inf:
            break
        best = min(best, way)
        for a in range(6):
            error[a] /= max(way, 1.0)
        _cost(rule, q, slope, scale)
        _newton_step(J, error, slope, scale, step)
        largest, whole = _within_room(rule, q, step)
        for i in range(n):
            q[i] += step[i]
        if way < 1.0 and whole and largest < _CONVERGED:
            return position_error, rotation_error, True
    return position_error, rotation_error, position_error <= POSITION_TOLERANCE and rotation_error <= ROTATION_TOLERANCE


@compiled
def _pose_error(position, quat, found, rotation, error):
    """Fill target less found, position and rotation vector, world axes, (6,); give their lengths in m and rad."""
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
def _cost(rule, q, slope, scale):
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
def _newton_step(J, error, slope, scale, step):
    """Fill the step of Newton's method on W − μ · pose, (n,).

    In joints scaled so that W'' = 1, rows of Y from Gram and Schmidt: the first span what moves the tool, the others
    are the null space Z. Along the first the step takes the error off; along the others it goes down W − μ · pose,
    whose second derivative is 1 − C, C being the curvature of the pose times μ.
    """
    n = slope.shape[0]
    Y, L, C, made_by = stack_matrix(n, n), stack_matrix(6, n), stack_matrix(n, n), stack_vector(n)
    pull, mu, along = stack_vector(n), stack_vector(6), stack_vector(n)
    rank = _task_rows(J, scale, Y, L, made_by)
    _complete(Y, rank)
    for k in range(n):
        pull[k] = 0.0
        for i in range(n):
            pull[k] -= Y[k, i] * slope[i] * scale[i]
    step[:] = 0.0
    for k in range(rank):  # L along = error
        a = int(made_by[k])
        along[k] = error[a]
        for j in range(k):
            along[k] -= L[a, j] * along[j]
        along[k] /= L[a, k]
        for i in range(n):
            step[i] += along[k] * Y[k, i]
    if rank < n:
        _multipliers(L, made_by, pull, rank, mu)
        _curvature(J, mu, scale, C)
        _descend(Y, C, pull, rank, step)
    for i in range(n):
        step[i] *= scale[i]


@compiled
def _task_rows(J, scale, Y, L, made_by):
    """Fill orthonormal rows Y (n, n) and L (6, n) with J diag(scale) = L Y, and which row of J made each of Y.

    Returns:
        How many; a row of J that adds next to nothing to those before it makes none.
    """
    n, rank = scale.shape[0], 0
    for a in range(6):
        if rank == n:
            break
        row = Y[rank]
        for i in range(n):
            row[i] = J[a, i] * scale[i]
        for k in range(rank):
            L[a, k] = dot(row, Y[k])
            for i in range(n):
                row[i] -= L[a, k] * Y[k, i]
        length = math.sqrt(dot(row, row))
        if length > _LOST:
            for i in range(n):
                row[i] /= length
            L[a, rank], made_by[rank] = length, a
            rank += 1
    return rank


@compiled
def _complete(Y, rank):
    """Fill the rows of Y, (n, n), from rank on so that all are orthonormal."""
    n = Y.shape[0]
    for row in range(rank, n):
        best, pivot = -1.0, 0
        for i in range(n):
            left = 1.0
            for k in range(row):
                left -= Y[k, i] * Y[k, i]
            if left > best:
                best, pivot = left, i
        for i in range(n):
            Y[row, i] = 1.0 if i == pivot else 0.0
        for k in range(row):
            part = Y[k, pivot]
            for i in range(n):
                Y[row, i] -= part * Y[k, i]
        length = math.sqrt(dot(Y[row], Y[row]))
        for i in range(n):
            Y[row, i] /= length


@compiled
def _multipliers(L, made_by, pull, rank, mu):
    """Fill what each task direction costs, μ with Lᵀ μ = −pull, (6,); 0 for those that made no row."""
    mu[:] = 0.0
    for k in range(rank - 1, -1, -1):
        cost = -pull[k]
        for j in range(k + 1, rank):
            cost -= L[int(made_by[j]), k] * mu[int(made_by[j])]
        mu[int(made_by[k])] = cost / L[int(made_by[k]), k]


@compiled
def _curvature(J, mu, scale, C):
    """Fill Σ μ_a ∂²x_a/∂q_i∂q_j in scaled joints, (n, n).

    Joint i carries the axis of every later one: ∂J_j/∂q_i = z_i × J_j for i ≤ j. A rotation vector's own second
    derivative is the symmetric half of that.
    """
    for i in range(scale.shape[0]):
        x, y, z = J[3, i], J[4, i], J[5, i]
        ux, uy, uz = mu[1] * z - mu[2] * y, mu[2] * x - mu[0] * z, mu[0] * y - mu[1] * x
        vx, vy, vz = mu[4] * z - mu[5] * y, mu[5] * x - mu[3] * z, mu[3] * y - mu[4] * x
        for j in range(i, scale.shape[0]):
            linear = ux * J[0, j] + uy * J[1, j] + uz * J[2, j]
            angular = vx * J[3, j] + vy * J[4, j] + vz * J[5, j]
            C[i, j] = (linear + 0.5 * angular) * scale[i] * scale[j]
            C[j, i] = C[i, j]


@compiled
def _descend(Y, C, pull, rank, step):
    """Add Newton's step in the null space, rows of Y from rank on; where the cost is no bowl, steepest descent's."""
    n, m = Y.shape[0], Y.shape[0] - rank
    B, B_inv, wanted, bent = stack_matrix(m, m), stack_matrix(m, m), stack_vector(m), stack_vector(n)
    for k in range(m):
        for i in range(n):
            bent[i] = dot(C[i], Y[rank + k])
        wanted[k] = pull[rank + k] + dot(bent, step)
        for j in range(m):
            B[k, j] = (1.0 if j == k else 0.0) - dot(bent, Y[rank + j])
    if not spd_inverse(B, B_inv):
        B_inv[:] = 0.0
        for k in range(m):
            B_inv[k, k], wanted[k] = 1.0, pull[rank + k]
    for k in range(m):
        part = dot(B_inv[k], wanted)
        for i in range(n):
            step[i] += part * Y[rank + k, i]


@compiled
def _within_room(rule, q, step):
    """Shorten a step in place so that every joint stays within its range.

    Returns:
        The largest part of it as it was, rad, and whether it is whole.
    """
    largest, share = 0.0, 1.0
    for i in range(q.shape[0]):
        size = abs(step[i])
        room = rule.high[i] - q[i] if step[i] > 0.0 else q[i] - rule.low[i]
        if size * share > _ROOM * room:
            share = _ROOM * room / size
        if size * share > _STEP:
            share = _STEP / size
        largest = max(largest, size)
    for i in range(q.shape[0]):
        step[i] *= share
    return largest, share == 1.0
