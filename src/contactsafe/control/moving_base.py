"""A base that stands elsewhere than the model has it, or moves: what was told of it, and what follows from that."""

import math

import numpy as np
from numpy.typing import ArrayLike

from contactsafe.core.copying import Independent
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import matrix_to_quat, quat_to_matrix
from contactsafe.robot.arm import Pose, finite_array, unit_quaternion
from contactsafe.robot.nominal import Frame, NominalModel

_SMOOTH_S = 0.02
"""Time over which velocities told give an acceleration."""

_ELSEWHERE = 1e-3
"""A base that has moved by this, m or rad, has the posture of a target found anew."""


class MovingBase(Independent):
    """Where the base is, and how it moves.

    Attributes:
        is_told: whether anything was said of it.
    """

    def __init__(self) -> None:
        self.is_told = False
        self._base, self._twist, self._acceleration = Frame(np.zeros(3), np.eye(3)), np.zeros(6), np.zeros(3)
        self._before, self._passed_s = np.zeros(3), math.inf  # velocity told before, and time since
        self._is_estimated = False  # the acceleration, from velocities
        self._model = self._postured = Frame(np.zeros(3), np.eye(3))  # the model's world: now, and at the last posture

    def pass_time(self, seconds: float) -> None:
        """Count the time of a tick."""
        self._passed_s += seconds

    def forget_motion(self) -> None:
        """Begin anew with what velocities tell of the acceleration: time has gone by. What was told stands."""
        self._passed_s = math.inf
        if self._is_estimated:
            self._acceleration = np.zeros(3)

    def tell(self, pose: Pose, velocity: ArrayLike | None, acceleration: ArrayLike | None) -> None:
        """Take what `Controller.set_base` was given.

        Raises:
            InvalidInputError: a wrong shape, a number that is not finite, or a quaternion that is not of unit length.
        """
        if not isinstance(pose, Pose):
            raise InvalidInputError(f"pose is {type(pose).__name__}; give a contactsafe.Pose")
        position = finite_array(pose.position, (3,), "pose.position")
        rotation = quat_to_matrix(unit_quaternion(pose.quat, "pose.quat"))
        twist = finite_array(np.zeros(6) if velocity is None else velocity, (6,), "velocity")
        self._is_estimated = acceleration is None
        if acceleration is not None:
            self._acceleration = finite_array(acceleration, (3,), "acceleration")
        elif velocity is None:
            self._acceleration = np.zeros(3)
        elif 0.0 < self._passed_s < math.inf:
            wanted = (twist[:3] - self._before) / self._passed_s
            self._acceleration = wanted + math.exp(-self._passed_s / _SMOOTH_S) * (self._acceleration - wanted)
        if self._passed_s > 0.0:
            self._before, self._passed_s = twist[:3].copy(), 0.0
        self._base, self._twist, self.is_told = Frame(position, rotation), twist, True

    def place(self, nominal: NominalModel) -> None:
        """Have a nominal model stand and move so."""
        if self.is_told:
            self._model = nominal.move_base(self._base, self._twist, self._acceleration)

    def is_elsewhere(self) -> bool:
        """Tell whether the base has moved so far since the last time that a posture is another."""
        before, now = self._postured, self._model
        moved = max(abs(now.position - before.position).max(), abs(now.rotation - before.rotation).max())
        if moved > _ELSEWHERE:
            self._postured = now
        return bool(moved > _ELSEWHERE)

    def in_model(self, pose: Pose) -> Pose:
        """Return a pose of the world in what the model calls the world."""
        return _through(self._model.inverse(), pose) if self.is_told else pose


def _through(frame: Frame, pose: Pose) -> Pose:
    inner = frame.of(Frame(np.asarray(pose.position, dtype=float), quat_to_matrix(np.asarray(pose.quat, dtype=float))))
    return Pose(inner.position, matrix_to_quat(inner.rotation))
