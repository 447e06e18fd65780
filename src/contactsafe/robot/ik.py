"""Inverse kinematics: the posture that goes with a pose, a near answer to a near seed, and a patient search."""

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.arrays import Record, Vector
from contactsafe.core.compiled import compiled
from contactsafe.core.copying import Independent
from contactsafe.core.errors import UnreachableError
from contactsafe.core.files import readable
from contactsafe.core.linalg import dot
from contactsafe.core.rotation import orientation_error, quat_to_matrix
from contactsafe.robot.arm import Arm, Pose, finite_array, finite_range, unit_quaternion
from contactsafe.robot.dynamics import forward_kinematics
from contactsafe.robot.ik_few_joints import FEW, solve_position_first
from contactsafe.robot.ik_step import limited_step
from contactsafe.robot.posture import (
    POSITION_TOLERANCE,
    ROTATION_TOLERANCE,
    find_posture,
    posture_rule,
    turn_towards,
)
from contactsafe.robot.urdf import BASE_LINK, TIP_LINK, arm_urdf

try:
    from trac_ik import TracIK
except ImportError:  # no wheel for this platform: the compiled solver serves alone
    TracIK = None

_SEEDS = 20  # fixed random postures that a cold start tries
_ITERATIONS = 20


class InverseKinematics(Independent):
    """Find joint positions for tool poses, one thread at a time.

    An arm of fewer than six joints cannot serve all of a pose: it reaches the position, and of the orientations that it
    has there the one nearest.

    Args:
        arm: whose limits and kinematics count.
    """

    _bound = ("_reference",)

    def __init__(self, arm: Arm):
        self._arm, self._few = arm, arm.n < FEW
        self._rule = posture_rule(arm)
        self._nominal = arm.nominal()
        low, high = finite_range(arm.q_min, arm.q_max)
        middle = (low + high) / 2
        spread = np.random.default_rng(0).uniform(low, high, (_SEEDS, arm.n))
        self._seeds = [arm.home, middle, *spread]
        # Or the first call would compile or load in somebody's control loop.
        anywhere = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        self._from_seed(*anywhere, np.array(arm.home))
        self._posture(*anywhere)

    def posture(self, pose: Pose) -> np.ndarray:
        """Return the posture of a pose: of the joint positions that reach it, the ones nearest home.

        A function of the pose alone, to the bit, in bounded time; docs/concepts/posture.md says what is nearest and
        where a small change of the pose is a small change of the posture.

        Args:
            pose: of the tool, world; position (3,) m, unit quaternion w x y z (4,).

        Returns:
            Joint positions, (n,), rad; the tool is within `POSITION_TOLERANCE` and, of six joints and more, within
            `ROTATION_TOLERANCE`.

        Raises:
            InvalidInputError: wrong shape, not finite, or a quaternion that is not of unit length to 1e-3.
            UnreachableError: out of reach, or only by a path that `solve` may find in longer time.
        """
        position, quat = _checked_pose(pose)
        q, reached = self._posture(position, quat)
        if not reached:
            raise UnreachableError(
                f"pose at {_position_words(position)} has no posture within reach of home's, or none at all; move it "
                "towards the arm, turn it, or give a posture of your own, such as InverseKinematics.solve may find"
            )
        return q

    def posture_near(self, pose: Pose, q_seed: ArrayLike) -> np.ndarray:
        """Return `posture`, or where that rule finds none, joint positions reached straight from a seed.

        In bounded time as well: a target that is streamed over the workspace is followed through the places where no
        rule leads. There, and only there, the answer depends on the seed. With fewer than six joints the seed always
        comes first, or the orientation nearest to a moving target's would jump.

        Raises:
            InvalidInputError: as `posture`.
            UnreachableError: neither finds any.
        """
        if self._few:
            q, error = self._from_seed(*_checked_pose(pose), np.asarray(q_seed, dtype=float))
            if self._reached(error):
                return q
        try:
            return self.posture(pose)
        except UnreachableError:
            q, error = self._from_seed(*_checked_pose(pose), np.asarray(q_seed, dtype=float))
            if not self._reached(error):
                raise
            return q

    def solve(self, pose: Pose, q_seed: ArrayLike | None = None) -> np.ndarray:
        """Find joint positions within the limits that put the tool at a pose, however long it takes.

        Tries the compiled solver from `q_seed`, so a near seed gives a near answer; then `posture`; then home and other
        fixed seeds; then TRAC-IK (Beeson & Ames 2015), where it is installed and the arm has a
        description. The same call on the same arm gives the same answer, unless it was TRAC-IK's,
        whose search is random.

        Args:
            pose: of the tool, world; position (3,) m, unit quaternion w x y z (4,).
            q_seed: where to start, (n,), rad; None for the posture of the pose.

        Returns:
            Joint positions, (n,), rad; the tool is within `POSITION_TOLERANCE` and, of six joints and more, within
            `ROTATION_TOLERANCE`.

        Raises:
            InvalidInputError: wrong shape, not finite, or a quaternion that is not of unit length to 1e-3.
            UnreachableError: no solution found.
        """
        position, quat = _checked_pose(pose)
        near = [] if q_seed is None else [self._arm.joint_vector(q_seed, "q_seed")]
        for seed in near:
            q, error = self._from_seed(position, quat, seed)
            if self._reached(error):
                return q
        q, reached = self._posture(position, quat)
        if reached:
            return q
        nearest = (math.inf, math.inf)
        for seed in (*near, *self._seeds):
            q, error = self._from_seed(position, quat, seed)
            if self._reached(error):
                return q
            nearest = min(nearest, error, key=self._size)
        if not self._few and self._reference is not None:
            found = self._reference.ik(position, quat_to_matrix(quat), (*near, self._arm.home)[0])
            if found is not None:
                q, error = self._from_seed(position, quat, found)
                if self._reached(error):
                    return q
        raise UnreachableError(
            f"pose at {_position_words(position)} was not reached: the nearest found is "
            f"{self._words(*nearest)} away, allowed is {self._words(POSITION_TOLERANCE, ROTATION_TOLERANCE)}; "
            "move it towards the arm, turn it, or give another q_seed"
        )

    @cached_property
    def _reference(self):
        return trac_ik(self._arm)  # only where the compiled solver fails: building it takes 10 ms

    def _posture(self, position, quat) -> tuple[np.ndarray, bool]:
        if self._few:
            return self._first_posture(position, quat)
        q = np.empty(self._arm.n)
        return q, self._reached(find_posture(self._rule, position, quat, q))

    def _first_posture(self, position, quat) -> tuple[np.ndarray, bool]:
        """Search from home turned towards the position and from fixed seeds; return what is turned off the least."""
        towards = np.array(self._rule.home)
        turn_towards(self._rule, position, towards)
        best, least = self._arm.home.copy(), math.inf
        for seed in (towards, *self._seeds):
            q, error = self._from_seed(position, quat, seed)
            if self._reached(error) and error[1] < least:
                best, least = q, error[1]
            if least <= ROTATION_TOLERANCE:
                break
        return best, least < math.inf

    def _from_seed(self, position, quat, seed):
        q, search = np.empty(self._arm.n), solve_position_first if self._few else solve_ik
        error = search(self._nominal.handle, position, quat, seed, self._arm.q_min, self._arm.q_max, q)
        return q, error

    def _reached(self, error: tuple[float, float]) -> bool:
        return error[0] <= POSITION_TOLERANCE and (self._few or error[1] <= ROTATION_TOLERANCE)

    def _size(self, error: tuple[float, float]) -> float:
        """Return how large a pose error is in what counts of it."""
        return error[0] / POSITION_TOLERANCE + (0.0 if self._few else error[1] / ROTATION_TOLERANCE)

    def _words(self, position_error_m: float, rotation_error_rad: float) -> str:
        """Write for a message what of a pose error counts."""
        position = f"{1e3 * position_error_m:.1f} mm"
        return position if self._few else f"{position} and {math.degrees(rotation_error_rad):.2f}°"


def _position_words(position: np.ndarray) -> str:
    """Write a position for a message."""
    return f"[{', '.join(f'{x:.3f}' for x in position)}] m"


def _checked_pose(pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    return finite_array(pose.position, (3,), "pose.position"), unit_quaternion(pose.quat, "pose.quat")


def trac_ik(arm: Arm, timeout_s: float = 0.02) -> Any:
    """Set up TRAC-IK (Beeson & Ames 2015, Speed mode) on the generated URDF, with the arm's limits.

    Args:
        arm: with a description.
        timeout_s: how long one call may search, s.

    Returns:
        `trac_ik.TracIK`, whose `ik(position, rotation, seed)` gives joint positions (n,), rad, or None; or None where
        TRAC-IK is not installed or the arm came without description.
    """
    if TracIK is None or arm.description is None or arm.tool is None:
        return None
    with readable("arm.urdf", arm_urdf(arm.description, arm.tool)) as path:  # it is read once
        solver = TracIK(BASE_LINK, TIP_LINK, str(path), timeout=timeout_s)
    low, high = finite_range(arm.q_min, arm.q_max)
    solver.joint_limits = (low.tolist(), high.tolist())  # its URDF reader rounds them to single precision
    return solver


@compiled(nogil=True)
def solve_ik(
    handle: Record, position: Vector, quat: Vector, q_seed: Vector, q_min: Vector, q_max: Vector, q_out: Vector
) -> tuple[float, float]:
    """Put the tool at a pose by damped least squares from a seed.

    Levenberg-Marquardt with damping that grows with the error (Sugihara 2011): far steps are short and
    singularities do no harm, near ones are Gauss-Newton. Each step is the smallest that serves, so the arm's redundant
    motion stays where the seed left it, but for a step away from joint limits that are near.

    Args:
        handle: record of a nominal model that nobody else is using, `handle_dtype`.
        position: of the tool, world, (3,), m.
        quat: of the tool, world, unit w x y z, (4,).
        q_seed: where to start, (n,), rad.
        q_min: lower joint limits, (n,), rad.
        q_max: upper joint limits, (n,), rad.
        q_out: receives the joint positions, (n,), rad; always within the limits.

    Returns:
        Position error in m and rotation error in rad at `q_out`; NaN where the input was not finite.
    """
    n = q_seed.shape[0]
    found, rotation, J = np.empty(3), np.empty((3, 3)), np.empty((6, n))
    error, step = np.empty(6), np.empty(n)
    for i in range(n):
        q_out[i] = min(max(q_seed[i], q_min[i]), q_max[i])
    for iteration in range(_ITERATIONS + 1):
        forward_kinematics(handle, q_out, found, rotation, J)
        turn = orientation_error(quat, rotation)
        for k in range(3):
            error[k] = position[k] - found[k]
            error[3 + k] = turn[k]
        position_error = math.sqrt(dot(error[:3], error[:3]))
        rotation_error = math.sqrt(dot(turn, turn))
        if position_error <= POSITION_TOLERANCE and rotation_error <= ROTATION_TOLERANCE:
            break
        if iteration == _ITERATIONS or not position_error + rotation_error < math.inf:
            break
        limited_step(J, error, q_out, q_min, q_max, step)
        for i in range(n):
            q_out[i] = min(max(q_out[i] + step[i], q_min[i]), q_max[i])
    return position_error, rotation_error
