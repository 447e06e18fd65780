"""A Franka Research 3 by Franka's own client library, pylibfranka."""

import contextlib
import functools
import time
from typing import Any

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.hardware import realtime
from contactsafe.hardware.port import RobotError, RobotSilentError

COLLISION_NM, COLLISION_N = 60.0, 100.0
"""Torques and forces of contact from which the robot stops by itself: beyond what this controller lets a contact have
on an arm (30 N m, and what an impact adds), short of what breaks the arm."""

_RATE_NM = 1.0
"""A tick's change of torque that Franka's interface allows, N m: 1000 N m/s."""

_SILENT = "UDP receive"  # in the message of a library that does not tell errors of the network from others

_MISSING = "pylibfranka is not installed; install contactsafe[franka]"


@functools.cache
def _library() -> Any:
    try:
        import pylibfranka
    except ImportError:
        raise InvalidInputError(_MISSING) from None
    return pylibfranka


class FrankaPort:
    """One robot, by its address.

    Args:
        address: host name or address of its control.
        load: what the flange carries beyond what the robot was told in its own settings: mass, kg, centre of mass in
            the flange's frame, (3,), m, and inertia, (3, 3), kg m²; None to leave it as it is.
    """

    def __init__(self, address: str, load: tuple[float, np.ndarray, np.ndarray] | None = None):
        _ = self._library
        self._address, self._load = address, load
        self._robot: Any = None
        self._control: Any = None
        self._into: dict[str, np.ndarray] = {}
        self._filled: np.ndarray | None = None
        self._first_ms: int | None = None
        self.arrived_ns = 0
        self.torque_rate = np.full(7, _RATE_NM)

    @property
    def _library(self) -> Any:
        return _library()

    def connect(self) -> None:
        """Reach the robot; raise what it takes for a collision, tell it the load."""
        self.reach()
        with _named(self._library):
            torques, forces = [COLLISION_NM] * 7, [COLLISION_N] * 6
            self._robot.set_collision_behavior(torques, torques, forces, forces)
            if self._load is not None:
                mass, centre, inertia = self._load
                self._robot.set_load(mass, list(centre), list(np.asarray(inertia).reshape(9, order="F")))

    def recover(self) -> None:
        """Acknowledge the error that stopped it; what needs Desk or the emergency stop is refused by the robot."""
        with _named(self._library):
            self._robot.automatic_error_recovery()

    def reach(self) -> None:
        """Reach the robot to look at it; tell it nothing."""
        try:
            with _named(self._library), realtime.kept():
                self._robot = self._library.Robot(self._address, self._library.RealtimeConfig.kIgnore)
        except RobotError as error:
            what = (
                f"no Franka answers at {self._address} ({error.detail}); check the address, the cable, and FCI in Desk"
            )
            raise type(error)(error.names, what) from None

    def look(self, reading: np.ndarray) -> None:
        """Fill a reading of a robot at rest."""
        with _named(self._library):
            self._fill(reading, self._robot.read_once())

    def begin(self) -> None:
        """Take control; its time begins with the first state."""
        self._first_ms = None
        with _named(self._library), realtime.kept():
            self._control = self._robot.start_torque_control()

    def read(self, reading: np.ndarray) -> int:
        """Wait for the next state, a second at most; return the milliseconds since the last."""
        try:
            state, passed = self._control.readOnce()
        except Exception as error:
            raise as_ours(self._library, error) from None
        self.arrived_ns = time.perf_counter_ns()
        self._fill(reading, state)
        return round(1000.0 * passed.to_sec())

    def _fill(self, reading: np.ndarray, state: Any) -> None:
        """Fill a reading through views that are made once: a field of a record costs a microsecond each time."""
        if self._filled is not reading:
            self._filled = reading
            self._into = {name: reading[name].reshape(-1) for name in reading.dtype.names or ()}
        into = self._into
        milliseconds = round(1000.0 * state.time.to_sec())
        if self._first_ms is None:
            self._first_ms = milliseconds
        into["time"][0] = (milliseconds - self._first_ms) / 1000.0  # since control began: the same in every run
        into["q"][:], into["qd"][:] = state.q, state.dq
        into["torque"][:], into["commanded"][:] = state.tau_J, state.tau_J_d
        into["success_rate"][0], into["mode"][0] = state.control_command_success_rate, int(state.robot_mode)

    def write(self, torque: np.ndarray) -> None:
        """Send joint torques, (7,), N m, gravity not included."""
        try:
            self._control.writeOnce(self._library.Torques(torque.tolist()))
        except Exception as error:
            raise as_ours(self._library, error) from None

    def finish(self) -> None:
        """End the motion: the robot holds itself."""
        last = self._library.Torques([0.0] * 7)
        last.motion_finished = True
        with _named(self._library):
            self._control.writeOnce(last)
        self._control = None

    def close(self) -> None:
        """Let go of the connection; a motion that runs is ended by the robot."""
        self._control = self._robot = None

    def errors(self) -> tuple[str, ...]:
        """Return the errors that the robot reports now, by libfranka's names."""
        if self._robot is None:
            return ()
        with contextlib.suppress(RobotError), _named(self._library):
            state = self._robot.read_once()
            return error_names(state.current_errors) or error_names(state.last_motion_errors)
        return ()


def error_names(errors: Any) -> tuple[str, ...]:
    """Return the names of the flags that are set in libfranka's `Errors`."""
    names = (name for name in dir(errors) if not name.startswith("_"))
    return tuple(name for name in names if getattr(errors, name) is True)


@contextlib.contextmanager
def _named(library: Any) -> Any:
    """Raise what the library raises as a `RobotError` with libfranka's names of what went wrong."""
    try:
        yield
    except Exception as error:
        raise as_ours(library, error) from None


def as_ours(library: Any, error: Exception) -> Exception:
    """Return what the library raised as a `RobotError`; what is none of its errors as it is."""
    kinds = (getattr(library, "FrankaException", RuntimeError), RuntimeError, ValueError)
    silent = getattr(library, "NetworkException", ())
    if isinstance(error, silent) or (isinstance(error, kinds) and _SILENT in str(error)):
        return RobotSilentError((), _line(error))
    if isinstance(error, kinds):
        return RobotError(_names_in(str(error)), _line(error))
    return error


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]


def _names_in(text: str) -> tuple[str, ...]:
    """Return the names of libfranka's errors that a message has in brackets: `aborted by reflex! ["a", "b"]`."""
    inside = text.partition("[")[2].partition("]")[0]
    return tuple(name.strip().strip('"') for name in inside.split(",") if name.strip())
