"""Simulated worlds: arms under their controllers, one or many, in any backend; MuJoCo steps natively in threads."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from contactsafe.control.config import ControllerConfig
from contactsafe.control.controller import Controller
from contactsafe.control.params import fill_params
from contactsafe.control.records import controller_dtype, index_bounds
from contactsafe.core.compiled import compiled
from contactsafe.core.copying import Independent, Threads
from contactsafe.core.errors import InvalidInputError
from contactsafe.core.state import Entry, load_state_dict, of_generators, of_records, state_dict
from contactsafe.robot.arm import Arm, finite_array, require_arm
from contactsafe.sim import model_changes, mujoco_backend
from contactsafe.sim.backend import Backend, StepArrays, run_backend
from contactsafe.sim.base_sensor import sample_base_bias
from contactsafe.sim.config import WorldConfig
from contactsafe.sim.mujoco_record import fill_plant, point_plant
from contactsafe.sim.record import world_bounds, world_dtype
from contactsafe.sim.scene import build_plants
from contactsafe.sim.sensing import fill_errors, noise_channels
from contactsafe.sim.state import of_physics
from contactsafe.sim.stepping import run_ticks
from contactsafe.sim.truth import sample_dtype, step_metrics_dtype, trace_dtype

TICK_S = 0.001
"""Time step of plant and controller, s."""

MAX_TICKS = 17
"""Most ticks of one call: those of a policy step at 60 Hz."""


@compiled(nogil=True)
def run_worlds(
    start: int, stop: int, worlds: np.ndarray, controllers: np.ndarray, noise: np.ndarray, ticks: np.ndarray,
    metrics: np.ndarray, samples: np.ndarray, traces: np.ndarray,
) -> None:  # fmt: skip
    """Run ticks[i] ticks of each world from start to stop; see `run_ticks`."""
    for i in range(start, stop):
        run_ticks(worlds[i], controllers[i], noise[i], ticks[i], metrics[i], samples[i], traces[i])


@compiled(nogil=True)
def _read_one(worlds, i):
    mujoco_backend.read(worlds[i])


@compiled(nogil=True)
def _mirror_one(worlds, i):
    mujoco_backend.mirror(worlds[i])


def _one_each(world: WorldConfig | Sequence[WorldConfig] | None, n: int) -> list[WorldConfig]:
    if world is None or isinstance(world, WorldConfig):
        return [world or WorldConfig()] * n
    configs = list(world)
    if len(configs) != n:
        raise InvalidInputError(f"{len(configs)} world configurations for {n} worlds; give one, or one each")
    return configs


def _check_tick(controller: ControllerConfig | None) -> None:
    if controller is not None and controller.clock.dt != TICK_S:
        raise InvalidInputError(f"controller dt = {controller.clock.dt} s; simulated worlds tick every {TICK_S} s")


class Worlds(Independent):
    """N independent worlds.

    A copy, pickled or not, has worlds of its own and goes on from where these are.

    Args:
        arm: with a description and a tool, such as `robots.panda()` or one of `robots.from_mjcf`.
        world: plant, sensors, fixtures, obstacles; one for all, or one for each.
        controller: a preset or another configuration, the same for all.
        n: how many.
        seed: of the sensors' noise and bias; world i samples from its own stream. One for all, or one for each: then
            what a world does depends on nothing but its own.
        shared: whether equal configurations use one model; false where models change from episode to episode.
        backend: what computes the physics in place of MuJoCo: `backend(arm, config, tick_s)` makes one for each world.
            It steps in Python, one world after the other.

    Attributes:
        records, controllers, metrics: arrays of `world_dtype`, `controller_dtype`, `step_metrics_dtype` records, (n,).
        samples: `sample_dtype` records of the last step's ticks, (n, MAX_TICKS).
        models, datas: MuJoCo's, the geometry of the worlds in every backend.
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
        backend: Callable[[Arm, WorldConfig, float], Backend] | None = None,
    ):
        self.arm, self.n = require_arm(arm), n
        self.configs = _one_each(world, n)
        _check_tick(controller)
        self.models = build_plants(arm, self.configs, shared)
        self.records = np.zeros(n, dtype=world_dtype(arm.n))
        self.controllers = np.zeros(n, dtype=controller_dtype(arm.n))
        self.metrics = np.zeros(n, dtype=step_metrics_dtype)
        self.samples = np.zeros((n, MAX_TICKS), dtype=sample_dtype)
        self._owners = [Controller(arm, controller, self.controllers, i) for i in range(n)]
        self._bind()
        for record, model, config in zip(self.records, self.models, self.configs, strict=True):
            fill_plant(record["plant"], model, config)
            fill_errors(record["errors"], arm, config, TICK_S)
        self._channels = [noise_channels(arm.n, config.sensors) for config in self.configs]
        self._noise = np.zeros((n, MAX_TICKS, max(self._channels)))
        self.no_trace = np.zeros((n, 0), dtype=trace_dtype(arm.n))
        self._threads = Threads(min(n, os.cpu_count() or 1))
        self.backends = [backend(arm, config, TICK_S) for config in self.configs] if backend else []
        self.seed(seed)

    def _bind(self) -> None:
        self.datas = [mujoco.MjData(model) for model in self.models]
        for record, model, data in zip(self.records, self.models, self.datas, strict=True):
            point_plant(record["plant"], model, data)

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "physics": of_physics(self.models, self.datas).read()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        physics = state.pop("physics")
        super().__setstate__(state)
        of_physics(self.models, self.datas).write(physics)

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

    def reset(self, i: int, q: ArrayLike, stiffness: ArrayLike | None = None) -> None:
        """Put world i's arm at rest at q (n,) rad, with a new sensor bias; `stiffness` as of `Controller.reset`."""
        q = self.arm.joint_vector(q, "q")
        model, data, record = self.models[i], self.datas[i], self.records[i]
        mujoco.mj_resetData(model, data)
        model.qpos_spring[self.arm.n :] = model.qpos0[self.arm.n :]  # obstacles that travelled are back
        data.qpos[: self.arm.n] = q
        gravity = self.arm.dynamics(q, np.zeros(self.arm.n))["g"]
        self._owners[i].reset(q, None, np.clip(gravity, -self.arm.tau_max, self.arm.tau_max), stiffness)
        data.ctrl[:] = gravity
        mujoco.mj_forward(model, data)
        record["tick"], record["push"]["body"], record["plant"]["obstacle_stopped"] = 0, 0, 0
        errors, sensors = record["errors"], self.configs[i].sensors
        errors["q_seen"], errors["qd_seen"], errors["tau_delayed"] = q, 0.0, gravity
        errors["wrench_bias"][:3] = sensors.force_bias_n * self.rngs[i].standard_normal(3)
        errors["wrench_bias"][3:] = sensors.moment_bias_nm * self.rngs[i].standard_normal(3)
        if sensors.joint_torque:
            errors["joints"]["torque_bias"] = sensors.joint_torque_bias_nm * self.rngs[i].standard_normal(self.arm.n)
        sample_base_bias(errors["base"], sensors, self.rngs[i])
        errors["bristle"], errors["joints"]["band"], errors["joints"]["qd_before"] = 0.0, 0.0, 0.0
        errors["joints"]["torque_held"], record["motor"], record["drag"] = gravity, gravity, 0.0
        record["pushed_wrench"] = 0.0
        if self.backends:
            self.backends[i].reset(q)
            self.backends[i].read(record)
            _mirror_one(self.records, i)
        else:
            _read_one(self.records, i)

    def place(self, i: int, q: ArrayLike) -> None:
        """Put world i's arm at q (n,) rad for a picture: nothing but the places of its shapes is brought up to date."""
        self.datas[i].qpos[: self.arm.n] = self.arm.joint_vector(q, "q")
        mujoco.mj_kinematics(self.models[i], self.datas[i])

    def state_entries(self) -> dict[str, Entry]:
        """List what decides the worlds' future, in the order in which it must be put back."""
        changing = world_bounds(min(model.nbody for model in self.models))
        return {
            "physics": of_physics(self.models, self.datas),
            "records": of_records(self.records, changing, fixed=("",)),
            "controllers": of_records(self.controllers, index_bounds(self.controllers[0]), fixed=("handle", "params")),
            "metrics": of_records(self.metrics),
            "noise": of_generators(self.rngs),
        }

    def state_dict(self) -> dict[str, Any]:
        """Return all that decides the worlds' future, as plain values and arrays; see `contactsafe.core.state`."""
        return state_dict(self.state_entries())

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Load the state of worlds made alike: they go on as those did, to the bit.

        Raises:
            InvalidInputError: it is of other worlds, or of another version.
        """
        load_state_dict(self.state_entries(), state)

    def close(self) -> None:
        """Stop the threads, and end the backends."""
        self._threads.close()
        for backend in self.backends:
            backend.close()

    def sample_noise(self, start: int = 0, stop: int | None = None) -> np.ndarray:
        """Sample the sensors' noise for one step of worlds start to stop, in its place in (n, MAX_TICKS, channels)."""
        for i in range(self.n)[start:stop]:
            noise, channels = self._noise[i], self._channels[i]
            if channels == noise.shape[1]:
                self.rngs[i].standard_normal(out=noise)
            else:  # a world's noise depends on nothing but its own sensors
                noise[:, :channels] = self.rngs[i].standard_normal((len(noise), channels))
        return self._noise

    def in_threads(self, run: Callable[[int, int], None]) -> None:
        """Call run(start, stop) on consecutive ranges of worlds, one a thread; raise what they raise."""
        if self.n == 1 or self.backends:
            run(0, self.n)
            return
        workers = self._threads.count
        bounds = np.linspace(0, self.n, workers + 1).astype(int)
        for future in [self._threads.submit(run, bounds[k], bounds[k + 1]) for k in range(workers)]:
            future.result()

    def run(self, ticks: int | np.ndarray, trace: np.ndarray | None = None) -> None:
        """Run control ticks in every world.

        Args:
            ticks: 1 to MAX_TICKS; a number or one for each world.
            trace: `trace_dtype` records to fill, (n, at least ticks); None to record nothing.

        Raises:
            InvalidInputError: too many ticks, none, or a trace too short for them.
        """
        ticks = self._checked(ticks, trace)
        self.in_threads(lambda start, stop: self.run_some(start, stop, ticks, trace))

    def run_some(self, start: int, stop: int, ticks: np.ndarray, trace: np.ndarray | None = None) -> None:
        """Run the worlds from start to stop, in the calling thread; `ticks` (n,) and `trace` are sound."""
        noise, traces = self.sample_noise(start, stop), self.no_trace if trace is None else trace
        arrays = StepArrays(self.records, self.controllers, noise, ticks, self.metrics, self.samples, traces)
        if not self.backends:
            run_worlds(start, stop, *arrays)
            return
        for i in range(start, stop):
            run_backend(self.backends[i], i, arrays)
            _mirror_one(self.records, i)

    def _checked(self, ticks: int | np.ndarray, trace: np.ndarray | None) -> np.ndarray:
        """Return the ticks of each world, (n,), after checking them and the trace."""
        ticks = np.broadcast_to(np.asarray(ticks, dtype=np.int64), (self.n,))
        most = int(ticks.max())
        if ticks.min() < 1 or most > MAX_TICKS:
            raise InvalidInputError(f"ticks = {ticks.min() if ticks.min() < 1 else most}; give 1 to {MAX_TICKS}")
        if trace is not None and (trace.ndim != 2 or trace.shape[0] != self.n or trace.shape[1] < most):
            raise InvalidInputError(f"trace has shape {trace.shape}; give ({self.n}, {most}) or more")
        return ticks

    def place_fixture(self, i: int, name: str, position: ArrayLike, quat: ArrayLike) -> None:
        """Put a fixture of world i elsewhere; the worlds must have a model each. Reset the world next.

        Args:
            i: which world.
            name: of the fixture.
            position: of its frame, world, (3,), m.
            quat: its orientation, w x y z, (4,).

        Raises:
            InvalidInputError: other worlds use the model, there is no such fixture, or the place is none.
        """
        model = model_changes.own_model(self.models, i)
        position, quat = model_changes.place_fixture(model, self.configs[i], name, position, quat)
        if self.backends:
            self.backends[i].place_fixture(name, position, quat)

    def set_tip_friction(self, i: int, friction: float) -> None:
        """Give the tip of world i's tool another Coulomb coefficient; reset the world next.

        Raises:
            InvalidInputError: it has no tip, other worlds use the model, or the coefficient is none.
        """
        model_changes.set_tip_friction(model_changes.own_model(self.models, i), self.arm, friction)
        if self.backends:
            self.backends[i].set_tip_friction(friction)

    def push(
        self, i: int, body: str, point: ArrayLike, force: ArrayLike, start_s: float, stop_s: float, ramp_s: float = 0.02
    ) -> None:
        """Push a link of world i.

        Args:
            i: which world.
            body: 'link1' … 'link<n>' or 'tool'.
            point: in the body's frame, (3,), m.
            force: world axes, (3,), N.
            start_s, stop_s: since reset, s.
            ramp_s: time from nothing to full force, s.

        Raises:
            InvalidInputError: no such body, or numbers that are none.
        """
        index = model_changes.pushed_body(self.models[i], self.arm, body)
        point, force = finite_array(point, (3,), "point"), finite_array(force, (3,), "force")
        push = self.records[i]["push"]
        push["body"], push["point"], push["force"] = index, point, force
        push["start"], push["stop"] = round(start_s / TICK_S), round(stop_s / TICK_S)
        push["ramp"] = max(1, round(ramp_s / TICK_S))
