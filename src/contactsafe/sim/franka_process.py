"""The simulated Franka in a process of its own, for the time of a run."""

import multiprocessing
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import TracebackType

import numpy as np

from contactsafe.core.copying import Unique
from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.franka_scene import FrankaScene
from contactsafe.sim.franka_server import Effect, serve

_READY_S = 900.0


class SimulatedRobot(Unique):
    """A context in which a simulated Franka listens on this machine.

    Args:
        scene, home, lockstep, effect, truth: as `contactsafe.sim.franka_server.serve` takes them.

    Attributes:
        address: that it listens at, once it does.
    """

    _why = "a simulated robot is a process; make another one"

    def __init__(
        self,
        scene: FrankaScene,
        home: np.ndarray,
        lockstep: bool,
        effect: Effect | None = None,
        truth: Path | None = None,
    ):
        self._context = multiprocessing.get_context("spawn")
        self.address = ""
        self._told: Connection
        self._told, theirs = self._context.Pipe()
        arguments = (scene, home, lockstep, effect, theirs, truth)
        self.process: BaseProcess = self._context.Process(target=serve, args=arguments, name="simulated robot")

    def __enter__(self) -> "SimulatedRobot":
        self.process.start()
        said = self._told.recv() if self._told.poll(_READY_S) else "it did not get ready"
        ready, _, self.address = said.partition(" ")
        if ready != "ready":
            self.process.kill()
            raise InvalidInputError(f"simulated robot: {said}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.is_alive():
            self._told.send("end")
            self.process.join(10.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join(1.0)
