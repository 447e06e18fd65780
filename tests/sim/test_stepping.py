"""Native stepping is the loop that anybody would write with the public Python API, to the last bit."""

import math
from dataclasses import fields

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from tests.sim.scenes import BOARD_Z, CALM, DOWN, aim, panda, posture, run, worlds_at

from contactsafe.control.controller import Controller
from contactsafe.control.presets import by_name
from contactsafe.control.signals import Measurement, Target
from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.arm import Pose
from contactsafe.sim.config import PlantConfig, SensorConfig, WorldConfig
from contactsafe.sim.fixtures import Box, Fixture, workbench
from contactsafe.sim.obstacles import Obstacle
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import MAX_TICKS, Worlds

TICKS = 36 * MAX_TICKS
START, GOAL = (0.5, 0.0, BOARD_Z + 0.004), (0.5, -0.12, BOARD_Z - 0.006)
IN_THE_WAY = Obstacle((0.14, -0.13, 0.55), radius=0.05, stiffness=3000.0)
BUSY = WorldConfig(obstacles=(IN_THE_WAY,))
"""Noise, a plate under the tip, and something for the forearm to meet."""

STATE = ("qpos", "qvel", "ctrl", "qfrc_applied", "sensordata")


def busy_worlds(config=BUSY, n=1, seed=3, preset="safe"):
    worlds = worlds_at(START, config, preset, n, seed)
    for i in range(n):
        aim(worlds, GOAL, i)
        worlds.push(i, "link4", (0.0, 0.05, 0.0), (0.0, 20.0, 5.0), 0.3, 0.5)
    return worlds


def assert_same_state(mine, theirs):
    for name in STATE:
        assert_array_equal(getattr(mine, name), getattr(theirs, name), err_msg=name)


class NumpyLoop:
    """A second writing of sensing, friction and push, noise off, around the public `Controller`."""

    def __init__(self, config, preset):
        self.arm = panda()
        built = Worlds(self.arm, config, by_name(preset))
        self.model, self.data = built.models[0], built.datas[0]
        q = posture(START)
        self.controller = Controller(self.arm, by_name(preset))
        self.controller.reset(q)
        dynamics = self.arm.dynamics(q, np.zeros(7))
        self.rotation = dynamics["rotation"].copy()
        self.data.qpos[:7], self.data.ctrl[:] = q, dynamics["g"]
        mujoco.mj_forward(self.model, self.data)
        stiffness = np.full(6, 150.0)
        self.target = Target(Pose(np.array(GOAL), DOWN), stiffness, 2.0 * np.sqrt(stiffness), posture(GOAL, DOWN))
        self.tick = 0

    def wrench(self):
        """Environment on tool at the tool point, world axes: specific force times mass, less what the sensor reads."""
        tool, read = self.arm.tool, self.data.sensor
        ma = tool.inertia.mass * read("wrist_accelerometer").data
        force = ma - read("wrist_force").data
        moment = cross(tool.inertia.com, ma) - read("wrist_torque").data
        moment -= cross(tool.tcp, force)
        return np.concatenate([turned(self.rotation, force), turned(self.rotation, moment)])

    def friction(self):
        return np.array(
            [
                a / (1.0 + math.exp(-b * (v + c))) - a / (1.0 + math.exp(-b * c))
                for (a, b, c), v in zip(self.arm.friction, self.data.qvel[:7], strict=True)
            ]
        )

    def push(self):
        """20 ms of ramp, then 20 N to the left and 5 N up at link 4, from 0.3 to 0.5 s."""
        if not 300 <= self.tick < 500:
            return np.zeros(7)
        body = self.model.body("link4").id
        point = self.data.xpos[body] + turned(self.data.xmat[body].reshape(3, 3), (0.0, 0.05, 0.0))
        J = np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, J, np.zeros_like(J), point, body)
        fraction = min(1.0, (self.tick - 300 + 1) / 20)
        return sum(J[k, :7] * f * fraction for k, f in enumerate((0.0, 20.0, 5.0)))

    def step(self):
        out = self.controller.step(
            Measurement(self.data.qpos[:7].copy(), self.data.qvel[:7].copy(), self.wrench()), self.target
        )
        self.rotation = self.controller.record["dynamics"]["rotation"].copy()
        self.data.ctrl[:] = out.torque
        self.data.qfrc_applied[:7] = self.push() - self.friction()
        mujoco.mj_step(self.model, self.data)
        self.tick += 1
        return out.torque


def cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def turned(R, v):
    """R v, summed in the order of a loop: BLAS may fuse and differ in the last bit."""
    return R[:, 0] * v[0] + R[:, 1] * v[1] + R[:, 2] * v[2]


@pytest.mark.parametrize("preset", ["vices", "safe"])
def test_native_loop_is_bit_identical_to_a_numpy_one_around_the_public_controller(preset):
    config = WorldConfig(sensors=CALM.sensors, obstacles=(IN_THE_WAY,))
    native, loop = busy_worlds(config, preset=preset), NumpyLoop(config, preset)
    trace = run(native, TICKS)[0]
    torques = np.array([loop.step() for _ in range(TICKS)])
    assert_array_equal(trace["torque"], torques)
    assert_same_state(native.datas[0], loop.data)
    assert np.linalg.norm(trace["tool_force"], axis=1).max() > 1.0
    assert trace["obstacle_force"].max() > 1.0


def test_many_worlds_in_threads_are_as_many_single_worlds():
    configs = [BUSY, WorldConfig(plant=PlantConfig(payload_kg=0.3)), WorldConfig(obstacles=(IN_THE_WAY,) * 2)]
    many = busy_worlds(configs, n=3)
    together = run(many, 20 * MAX_TICKS)
    streams = np.random.SeedSequence(3).spawn(3)
    for i, config in enumerate(configs):
        one = Worlds(panda(), config, by_name("safe"))
        one.rngs = [np.random.Generator(np.random.SFC64(streams[i]))]
        one.reset(0, posture(START))
        aim(one, GOAL)
        one.push(0, "link4", (0.0, 0.05, 0.0), (0.0, 20.0, 5.0), 0.3, 0.5)
        alone = run(one, 20 * MAX_TICKS)[0]
        for name in together.dtype.names:
            assert_array_equal(alone[name], together[i][name], err_msg=name)
        assert_same_state(one.datas[0], many.datas[i])
    many.close()


def test_one_seed_one_result_another_seed_another():
    first, again, other = (run(busy_worlds(seed=seed), 5 * MAX_TICKS)[0] for seed in (3, 3, 4))
    assert_array_equal(first["torque"], again["torque"])
    assert np.abs(first["torque"] - other["torque"]).max() > 1e-3


def test_reset_leaves_nothing_behind_but_the_noise():
    worlds = busy_worlds(CALM)
    first = run(worlds, 10 * MAX_TICKS)[0]
    worlds.reset(0, posture(START))
    aim(worlds, GOAL)
    worlds.push(0, "link4", (0.0, 0.05, 0.0), (0.0, 20.0, 5.0), 0.3, 0.5)
    again = run(worlds, 10 * MAX_TICKS)[0]
    assert_array_equal(first["torque"], again["torque"])


def test_a_delayed_torque_arrives_one_tick_later():
    prompt, late = (
        busy_worlds(WorldConfig(sensors=CALM.sensors, plant=PlantConfig(torque_delay_ticks=d))) for d in (0, 1)
    )
    sent, held = run(prompt, 1)[0]["torque"][0], late.records[0]["errors"]["tau_delayed"].copy()
    run(late, 1)
    assert_array_equal(prompt.datas[0].ctrl, sent)
    assert_array_equal(late.datas[0].ctrl, held)
    second = run(late, 1)[0]["torque"][0]
    assert_array_equal(late.datas[0].ctrl, sent)
    assert_array_equal(late.records[0]["errors"]["tau_delayed"], second)


def test_worlds_of_other_plants_differ():
    plants = (PlantConfig(), PlantConfig(friction_scale=0.0), PlantConfig(inertia_scale=1.1), PlantConfig(payload_kg=1))
    ends = [run(busy_worlds(WorldConfig(plant=p, sensors=CALM.sensors)), 340)[0]["q"][-1] for p in plants]
    for other in ends[1:]:
        assert np.abs(other - ends[0]).max() > 1e-4


def test_a_configuration_too_few_is_refused():
    with pytest.raises(InvalidInputError) as caught:
        Worlds(panda(), [CALM, CALM], n=3)
    assert str(caught.value) == "2 world configurations for 3 worlds; give one, or one each"


def test_worlds_of_other_fixtures_step_together_as_each_does_alone():
    """A step for the tip to land on, a bare bench, and nothing at all."""
    step = Fixture("step", (0.5, 0.0, BOARD_Z + 0.01), (Box("top", (0.0, 0.0, -0.005), (0.1, 0.1, 0.005)),))
    configs = [WorldConfig(fixtures=fixtures) for fixtures in ((workbench(), step), (workbench(),), ())]
    goal = (0.5, 0.0, BOARD_Z + 0.004)
    above = (0.5, 0.0, BOARD_Z + 0.012)
    together = worlds_at(above, configs, n=3)
    for i in range(3):
        aim(together, goal, i)
    traces = run(together, 30 * MAX_TICKS)
    together.close()
    forces = np.linalg.norm(traces["tool_force"], axis=2).max(axis=1)
    assert forces[0] > 1.0
    assert not forces[1:].any()
    assert_array_equal(traces["q"][1], worlds_alone(configs[1], above, goal, 1))


def worlds_alone(config, start, goal, stream):
    """Run a world with the noise that the one of this number has among three; joint positions, (ticks, 7), rad."""
    worlds = worlds_at(start, config)
    worlds.rngs = [np.random.Generator(np.random.SFC64(np.random.SeedSequence(0).spawn(3)[stream]))]
    worlds.reset(0, posture(start))
    aim(worlds, goal)
    return run(worlds, 30 * MAX_TICKS)[0]["q"]


def test_two_fixtures_of_one_name_are_refused():
    with pytest.raises(InvalidInputError) as caught:
        WorldConfig(fixtures=(workbench(), workbench()))
    assert str(caught.value) == "fixtures are workbench, workbench; give at most 4, each with a name of its own"


@pytest.mark.parametrize(
    ("plant", "text"),
    [
        ({"torque_delay_ticks": 2}, "torque_delay_ticks = 2; give 0 or 1"),
        (
            {"payload_kg": math.nan},
            "plant (friction × 1.0, inertia × 1.0, payload nan kg) cannot exist; "
            "friction_scale must be ≥ 0, inertia_scale > 0, payload_kg finite",
        ),
        (
            {"friction_scale": (1.0, -0.1)},
            "plant (friction × (1.0, -0.1), inertia × 1.0, payload 0.0 kg) cannot exist; "
            "friction_scale must be ≥ 0, inertia_scale > 0, payload_kg finite",
        ),
        (
            {"inertia_scale": 0.0},
            "plant (friction × 1.0, inertia × 0.0, payload 0.0 kg) cannot exist; "
            "friction_scale must be ≥ 0, inertia_scale > 0, payload_kg finite",
        ),
    ],
)
def test_plants_that_cannot_exist_are_refused(plant, text):
    with pytest.raises(InvalidInputError) as caught:
        PlantConfig(**plant)
    assert str(caught.value) == text


@pytest.mark.parametrize("ticks", [0, MAX_TICKS + 1])
def test_more_ticks_than_there_is_noise_for_are_refused(ticks):
    with pytest.raises(InvalidInputError) as caught:
        worlds_at(START).run(ticks)
    assert str(caught.value) == f"ticks = {ticks}; give 1 to 17"


def test_a_trace_that_is_too_short_is_refused():
    with pytest.raises(InvalidInputError) as caught:
        worlds_at(START).run(5, np.zeros((1, 4), dtype=trace_dtype(7)))
    assert str(caught.value) == "trace has shape (1, 4); give (1, 5) or more"


def test_sensors_of_zero_deviation_are_exact():
    for field in fields(SensorConfig):
        exact = {"velocity_filter_hz": math.inf, "wrist": True}.get(field.name, 0.0)
        assert getattr(CALM.sensors, field.name) == exact
    worlds = worlds_at(START)
    run(worlds, 1)
    before = worlds.datas[0].qpos.copy()
    run(worlds, 1)
    assert_array_equal(worlds.controllers[0]["measurement"]["q"], before)
