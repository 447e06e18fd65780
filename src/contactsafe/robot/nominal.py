"""One private copy of an arm's nominal model, and where its base stands."""

import copy
from typing import NamedTuple

import mujoco
import numpy as np

from contactsafe.core.copying import Independent
from contactsafe.core.rotation import matrix_to_quat, quat_to_matrix
from contactsafe.robot.dynamics import make_handle


class Frame(NamedTuple):
    """Where a frame is in another.

    Attributes:
        position: (3,), m.
        rotation: its axes, (3, 3).
    """

    position: np.ndarray
    rotation: np.ndarray

    def of(self, inner: "Frame") -> "Frame":
        """Return where a frame is that is known in this one."""
        return Frame(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)

    def inverse(self) -> "Frame":
        """Return where the other frame is in this one."""
        return Frame(-self.rotation.T @ self.position, self.rotation.T)


class NominalModel(Independent):
    """One private copy of an arm's nominal model, to be used from one thread at a time.

    Attributes:
        handle: `handle_dtype` record for compiled code.
    """

    _bound = ("_data", "handle")

    def __init__(
        self, model: mujoco.MjModel, site: str, surface: np.ndarray, places: np.ndarray, base: Frame | None = None
    ):
        self._model, self._own = model, False
        self._base, self._at = base, np.zeros(3)
        self._site, self._surface = site, np.ascontiguousarray(surface, dtype=float)
        self._places = np.ascontiguousarray(places, dtype=float)
        self._twist, self._acceleration = np.zeros(6), np.zeros(3)
        self._bind()

    def _bind(self) -> None:
        self._data = mujoco.MjData(self._model)
        self.handle = make_handle(self._model, self._data, self._site, self._surface, self._places)[0]
        self._move()

    def move_base(self, base: Frame, twist: np.ndarray, acceleration: np.ndarray) -> Frame:
        """Have the base stand elsewhere than the model has it, or move; the handle is another after the first call.

        Args:
            base: of the body that carries the first joint, in the world.
            twist: of that body's origin, world axes, (6,), m/s and rad/s.
            acceleration: of it, (3,), m/s².

        Returns:
            Where what the model calls the world is in the world.
        """
        if not self._own:
            self._model, self._own = copy.deepcopy(self._model), True
            self._stands, self._gravity = _standing(self._model), self._model.opt.gravity.copy()
            self._from = (_base_frame(self._model) if self._base is None else self._base).inverse()
            self._bind()
        moved = base.of(self._from)
        for body, stands in self._stands.items():
            frame = moved.of(stands)
            self._model.body_pos[body], self._model.body_quat[body] = frame.position, matrix_to_quat(frame.rotation)
        self._at, self._twist, self._acceleration = base.position, twist, acceleration
        self._model.opt.gravity[:] = self._gravity - acceleration
        self._move()
        return moved

    def _move(self) -> None:
        self.handle["base_position"] = self._at
        self.handle["base_twist"], self.handle["base_acceleration"] = self._twist, self._acceleration
        self.handle["gravity"] = self._model.opt.gravity


def _base_frame(model: mujoco.MjModel) -> Frame:
    """Return where the body that carries the first joint is."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body = int(model.body_parentid[model.jnt_bodyid[0]])
    return Frame(data.xpos[body].copy(), quat_to_matrix(data.xquat[body]))


def _standing(model: mujoco.MjModel) -> dict[int, Frame]:
    """Return where the bodies that stand in the world are in it."""
    standing = [body for body in range(1, model.nbody) if model.body_parentid[body] == 0]
    return {body: Frame(model.body_pos[body].copy(), quat_to_matrix(model.body_quat[body])) for body in standing}
