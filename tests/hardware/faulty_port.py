"""A port to a Franka by which a run goes wrong after 300 cycles, in one way or another."""

import time

import numpy as np

from contactsafe.hardware.franka_port import FrankaPort

_AT = 300
_JUMP_NM, _RUNAWAY_NM = 5.0, 0.5


class FaultyPort(FrankaPort):
    """Does what it is named for.

    Args:
        address: of the robot.
        fault: "jump", "runaway", "stall 25" (ms), "lose 19" (commands), or "none".
    """

    def __init__(self, address, fault):
        super().__init__(address)
        self._fault, self._cycle, self._last = fault.split(), 0, np.zeros(7)

    def write(self, torque):
        self._cycle += 1
        what, much = self._fault[0], int(self._fault[-1]) if len(self._fault) > 1 else 0
        if what == "runaway" and self._cycle > _AT:
            torque = np.clip(self._last + _RUNAWAY_NM * (np.arange(7) == 4), -8.0, 8.0)
        if what == "jump" and self._cycle == _AT:
            torque = torque + _JUMP_NM * (np.arange(7) == 5)
        if what == "stall" and self._cycle == _AT:
            time.sleep(much / 1000.0)
        self._last = np.array(torque)
        if what == "lose" and _AT < self._cycle <= _AT + much:
            return
        super().write(torque)
