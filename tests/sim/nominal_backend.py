"""The least that can carry a world: an integrator of the arm's nominal dynamics, which touches nothing."""

import numpy as np

from contactsafe.core.errors import InvalidInputError


class NominalBackend:
    """M q̈ = τ − c − g by semi-implicit Euler; its wrist sensor is one that has no weight to carry."""

    def __init__(self, arm, config, tick_s):
        if config.obstacles:
            raise InvalidInputError(f"{len(config.obstacles)} obstacles asked for; the nominal dynamics meet none")
        self._arm, self._tick_s, self._torque = arm, tick_s, np.zeros(arm.n)

    def reset(self, q):
        self._q, self._qd = np.array(q, dtype=float), np.zeros(self._arm.n)

    def read(self, world):
        truth, dynamics = world["truth"], self._arm.dynamics(self._q, self._qd)
        for name in truth.dtype.names:
            truth[name] = 0.0
        truth["q"], truth["qd"] = self._q, self._qd
        truth["position"], truth["rotation"] = dynamics["position"], dynamics["rotation"]

    def write(self, world):
        if world["push"]["fraction"] > 0.0:
            raise InvalidInputError("a push is asked for; the nominal dynamics know none")
        world["pushed"] = 0.0
        self._torque = world["motor"] - world["drag"]

    def step(self):
        dynamics = self._arm.dynamics(self._q, self._qd)
        self._qd = self._qd + self._tick_s * dynamics["M_inv"] @ (self._torque - dynamics["c"] - dynamics["g"])
        self._q = self._q + self._tick_s * self._qd

    def place_fixture(self, name, position, quat):
        raise InvalidInputError(f"fixture '{name}' is to be placed; the nominal dynamics meet none")

    def set_tip_friction(self, friction):
        pass  # the tip meets nothing

    def close(self):
        pass
