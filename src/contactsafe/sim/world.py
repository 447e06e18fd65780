"""Simulated worlds: an arm under its controller before a whiteboard, one or many, stepped natively."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from contactsafe.control.config import ControllerConfig
from contactsafe.control.controller import Controller
from contactsafe.control.params import fill_params
from contactsafe.control.records import controller_dtype, index_bounds
from contactsafe.core.compiled import compiled
from contactsafe.core.copying import Independent, Threads
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Arm
from contactsafe.sim.camera import camera_tables, plane_homography, render_mask, stack_cameras
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.ink import empty_ink_index, enter
from contactsafe.sim.records import (
    fill_plant,
    noise_channels,
    plant_bounds,
    plant_dtype,
    point_plant,
    step_metrics_dtype,
    trace_dtype,
)
from contactsafe.sim.scene import build_plant
from contactsafe.sim.snapshot import Part, of_array, of_generators, of_physics, of_records, put, take
from contactsafe.sim.stepping import run_ticks
from contactsafe.sim.whiteboard import CLEAN, INK, OBJECT, Whiteboard

POLICY_RATE_HZ = 60
"""Rate of the policy; 1 kHz does not divide by it, so its steps last 17, 17 and 16 ticks in turn."""

TICK_S = 0.001
"""Time step of plant and controller, s."""

MAX_TICKS = 17


def ticks_of_step(step: int) -> int:
    """Give the number of 1 kHz ticks of the policy step with this number, 17, 17, 16 in turn."""
    return 16 if step % 3 == 2 else 17


@compiled(nogil=True)
def run_worlds(start, stop, plants, controllers, cells, noise, ticks, reports, traces):
    """Run ticks[i] ticks of each world from start to stop; see `run_ticks`."""
    for i in range(start, stop):
        run_ticks(plants[i], controllers[i], cells[i], noise[i], ticks[i], reports[i], traces[i])


def _one_each(world: WorldConfig | Sequence[WorldConfig] | None, n: int) -> list[WorldConfig]:
    if world is None or isinstance(world, WorldConfig):
        return [world or WorldConfig()] * n
    configs = list(world)
    if len(configs) != n:
        raise InvalidInputError(f"{len(configs)} world configurations for {n} worlds; give one, or one each")
    if any(c.board != configs[0].board or c.camera != configs[0].camera for c in configs):
        raise InvalidInputError("worlds that step together must have the same board and camera; step the others apart")
    return configs


def _plants(arm: Arm, configs: list[WorldConfig], shared: bool) -> list[mujoco.MjModel]:
    """Compile a plant for each configuration, equal ones once, but for obstacles that travel: those move the model."""
    if not shared:
        return [build_plant(arm, c) for c in configs]
    compiled: dict[WorldConfig, mujoco.MjModel] = {}
    return [
        build_plant(arm, c) if any(any(o.travel) for o in c.obstacles)
        else compiled.setdefault(c, build_plant(arm, c)) if c not in compiled else compiled[c]
        for c in configs
    ]  # fmt: skip


def _check_tick(controller: ControllerConfig | None) -> None:
    if controller is not None and controller.clock.dt != TICK_S:
        raise InvalidInputError(f"controller dt = {controller.clock.dt} s; simulated worlds tick every {TICK_S} s")


class Worlds(Independent):
    """N independent worlds, stepped in native threads.

    A copy, pickled or not, has worlds of its own and goes on from where these are.

    Args:
        arm: built from a description, with a tool.
        world: plant, sensors, board, camera, obstacles; one for all, or one for each (same board and camera).
        controller: a preset or another configuration, the same for all.
        n: how many.
        seed: of the sensors' noise and bias; world i draws from its own stream. One for all, or one for each: then
            what a world does depends on nothing but its own.
        shared: whether worlds alike share a model; false where each is changed from episode to episode.

    Attributes:
        plants, controllers, reports: arrays of `plant_dtype`, `controller_dtype`, `step_metrics_dtype` records, (n,).
        cells: the boards, uint8, (n, rows, columns).
        boards: `Whiteboard` objects whose cells lie in `cells`.
        masks: what the cameras saw when `render` was last called, uint8, (n, size, size).
        camera: `CameraTables` as calibrated.
        cameras: those that look, side by side; `plants["camera"]` says which one at which world.
        ink_index: `InkIndex` of the boards and the cameras that look at them; `enter_changed` brings it up to date
            with what was drawn, tasks with what was wiped.
        homography: of board plane to mask pixels, (3, 3).
        no_trace: an empty trace, for `run_worlds` and its like.
    """

    _bound = ("datas",)

    def __init__(
        self,
        arm: Arm,
        world: WorldConfig | Sequence[WorldConfig] | None = None,
        controller: ControllerConfig | None = None,
        n: int = 1,
        seed: int | Sequence[int] | None = None,
        shared: bool = True,
    ):
        self.arm, self.n = arm, n
        self.configs = _one_each(world, n)
        _check_tick(controller)
        self.config = self.configs[0]
        self.models = _plants(arm, self.configs, shared)
        self.boards = [Whiteboard(self.config.board) for _ in range(n)]
        self.cells = np.zeros((n, *self.boards[0].cells.shape), dtype=np.uint8)
        self.plants = np.zeros(n, dtype=plant_dtype(arm.n))
        self.controllers = np.zeros(n, dtype=controller_dtype(arm.n))
        self.reports = np.zeros(n, dtype=step_metrics_dtype)
        self._owners = [Controller(arm, controller, self.controllers, i) for i in range(n)]
        self._bind()
        for i in range(n):
            fill_plant(self.plants[i], self.models[i], arm, self.configs[i])
            self.plants[i]["origin"] = self.boards[i].origin
        size = self.config.camera.size
        self.masks = np.full((n, size, size), 255, dtype=np.uint8)
        self.camera = camera_tables(self.config.camera, self.boards[0], self.models[0])
        self.cameras = stack_cameras([self.camera])
        self.ink_index = empty_ink_index(n, self.boards[0].cells.size, size)
        self.homography = plane_homography(self.config.camera, self.config.board.centre[2])
        self._noise = np.zeros((n, MAX_TICKS, noise_channels(arm.n)))
        self.no_trace = np.zeros((n, 0), dtype=trace_dtype(arm.n))
        self._threads = Threads(min(n, os.cpu_count() or 1))
        self.seed(seed)

    def _bind(self) -> None:
        self.datas = [mujoco.MjData(model) for model in self.models]
        for i, board in enumerate(self.boards):
            board.cells = self.cells[i]
            point_plant(self.plants[i], self.models[i], self.datas[i])

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "physics": of_physics(self.models, self.datas).take()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        physics = state.pop("physics")
        super().__setstate__(state)
        of_physics(self.models, self.datas).put(physics)

    def use(self, controller: ControllerConfig) -> None:
        """Put another controller in charge of every world, which costs far less than worlds of its own.

        Seed and reset them next: they then do what new worlds under that controller would do.

        Raises:
            InvalidInputError: its tick is not that of the worlds.
        """
        _check_tick(controller)
        for record in self.controllers:
            fill_params(record["params"], controller, self.arm)

    def seed(self, seed: int | Sequence[int] | None) -> None:
        """Start the worlds' noise anew, from one seed for all or one for each."""
        if seed is None or isinstance(seed, int | np.integer):
            streams = np.random.SeedSequence(seed).spawn(self.n)
        else:
            streams = [np.random.SeedSequence(one) for one in seed]
        self.rngs = [np.random.Generator(np.random.SFC64(stream)) for stream in streams]

    def reset(self, i: int, q) -> None:
        """Put world i's arm at rest at q (n,) rad, with a new sensor bias; the board stays as it is."""
        q = self.arm.joint_vector(q, "q")
        model, data, plant = self.models[i], self.datas[i], self.plants[i]
        mujoco.mj_resetData(model, data)
        model.qpos_spring[self.arm.n :] = model.qpos0[self.arm.n :]  # obstacles that travelled are back
        data.qpos[: self.arm.n] = q
        dynamics = self.arm.dynamics(q, np.zeros(self.arm.n))
        self._owners[i].reset(q, torque=np.clip(dynamics["g"], -self.arm.tau_max, self.arm.tau_max))
        data.ctrl[:] = dynamics["g"]
        mujoco.mj_forward(model, data)
        plant["tick"], plant["push_body"], plant["obstacle_stopped"] = 0, 0, 0
        plant["q_seen"], plant["qd_seen"] = q, 0.0
        plant["tau_delayed"] = dynamics["g"]
        sensors = self.configs[i].sensors
        plant["wrench_bias"][:3] = sensors.force_bias_n * self.rngs[i].standard_normal(3)
        plant["wrench_bias"][3:] = sensors.moment_bias_nm * self.rngs[i].standard_normal(3)

    def enter_ink(self, i: int) -> None:
        """Take down what lies on board i and where its camera shows it: it was drawn on, or the camera changed."""
        enter(self.ink_index, i, self.cells[i], self.cameras.pixels[self.plants[i]["camera"]])
        self.boards[i].changed = False

    def enter_changed(self) -> None:
        """Do so for every board that says it has changed."""
        for i, board in enumerate(self.boards):
            if board.changed:
                self.enter_ink(i)

    def place(self, i: int, q) -> None:
        """Put world i's arm at q (n,) rad for a picture: nothing but the places of its shapes is brought up to date."""
        self.datas[i].qpos[: self.arm.n] = self.arm.joint_vector(q, "q")
        mujoco.mj_kinematics(self.models[i], self.datas[i])

    def parts(self) -> dict[str, Part]:
        """List what decides the worlds' future, in the order in which it must be put back."""
        changing = plant_bounds(min(model.nbody for model in self.models), len(self.cameras.pixels))
        return {
            "physics": of_physics(self.models, self.datas),
            "plants": of_records(self.plants, changing, fixed=("",)),
            "controllers": of_records(self.controllers, index_bounds(self.controllers[0]), fixed=("handle", "params")),
            "reports": of_records(self.reports),
            "cells": of_array(self.cells, CLEAN, OBJECT),
            "masks": of_array(self.masks),
            "noise": of_generators(self.rngs),
        }

    def snapshot(self) -> dict[str, Any]:
        """Take all that decides the worlds' future, as plain values and arrays; see `contactsafe.sim.snapshot`."""
        return take(self.parts())

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Put the worlds where a snapshot of worlds made alike was taken: they go on as those did, to the bit.

        Raises:
            InvalidInputError: it is of other worlds, or of another version.
        """
        put(self.parts(), snapshot)
        for i in range(self.n):
            self.enter_ink(i)

    def close(self) -> None:
        """Stop the threads."""
        self._threads.close()

    def sample_noise(self, start: int = 0, stop: int | None = None) -> np.ndarray:
        """Draw the sensors' noise for one step of worlds start to stop, in its place in (n, MAX_TICKS, channels)."""
        for rng, noise in zip(self.rngs[start:stop], self._noise[start:stop], strict=True):
            rng.standard_normal(out=noise)
        return self._noise

    def in_threads(self, run) -> None:
        """Call run(start, stop) over all worlds, one share a thread; errors surface here."""
        if self.n == 1:
            run(0, 1)
            return
        workers = self._threads.count
        bounds = np.linspace(0, self.n, workers + 1).astype(int)
        for future in [self._threads.submit(run, bounds[k], bounds[k + 1]) for k in range(workers)]:
            future.result()

    def run(self, ticks, trace: np.ndarray | None = None) -> None:
        """Run control ticks in every world.

        Args:
            ticks: 1 to MAX_TICKS; a number or one for each world.
            trace: `trace_dtype` records to fill, (n, at least ticks); None to record nothing.

        Raises:
            InvalidInputError: too many ticks, none, or a trace too short for them.
        """
        ticks = self._checked(ticks, trace)
        traces = self.no_trace if trace is None else trace

        def share(start: int, stop: int) -> None:
            noise = self.sample_noise(start, stop)
            run_worlds(
                start, stop, self.plants, self.controllers, self.cells, noise, ticks, self.reports, traces
            )  # fmt: skip

        self.in_threads(share)

    def _checked(self, ticks, trace: np.ndarray | None) -> np.ndarray:
        """Give the ticks of each world, (n,), once they and the trace are sound."""
        ticks = np.broadcast_to(np.asarray(ticks, dtype=np.int64), (self.n,))
        most = int(ticks.max())
        if ticks.min() < 1 or most > MAX_TICKS:
            raise InvalidInputError(f"ticks = {ticks.min() if ticks.min() < 1 else most}; give 1 to {MAX_TICKS}")
        if trace is not None and (trace.ndim != 2 or trace.shape[0] != self.n or trace.shape[1] < most):
            raise InvalidInputError(f"trace has shape {trace.shape}; give ({self.n}, {most}) or more")
        return ticks

    def render(self) -> np.ndarray:
        """Draw every camera's mask, uint8, (n, size, size)."""
        for i in range(self.n):
            render_mask(self.camera, self.cells[i], self.plants[i], self.masks[i])
        return self.masks

    def ink_cells(self) -> np.ndarray:
        """Count the cells that hold ink, (n,)."""
        return np.count_nonzero(self.cells == INK, axis=(1, 2))

    def push(self, i: int, body: str, point, force, start_s: float, stop_s: float, ramp_s: float = 0.02) -> None:
        """Push a link of world i.

        Args:
            i: which world.
            body: 'link1' … 'link7' or 'tool'.
            point: in the body's frame, (3,), m.
            force: world axes, (3,), N.
            start_s, stop_s: since reset, s.
            ramp_s: time from nothing to full force, s.
        """
        plant = self.plants[i]
        plant["push_body"] = self.models[i].body(body).id
        plant["push_point"], plant["push_force"] = point, force
        dt = self.models[i].opt.timestep
        plant["push_start"], plant["push_stop"] = round(start_s / dt), round(stop_s / dt)
        plant["push_ramp"] = max(1, round(ramp_s / dt))
