"""The contract of a backend: whoever follows it, the worlds are the same but for the physics.

`NominalBackend` knows the arm's nominal dynamics and nothing else; `PublicMujoco` is the compiled form written again.
"""

import inspect
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.sim.nominal_backend import NominalBackend
from tests.sim.public_mujoco import PublicMujoco
from tests.sim.scenes import BOARD_Z, CALM, aim, panda, posture, run, worlds_at

from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.backend import Backend
from contactsafe.sim.bullet_backend import BulletBackend
from contactsafe.sim.config import NO_NOISE, REAL_SENSORS, PlantConfig, SensorConfig, WorldConfig
from contactsafe.sim.obstacles import Obstacle, bottle
from contactsafe.sim.worlds import MAX_TICKS

START, GOAL = (0.5, -0.1, 0.15), (0.45, 0.15, 0.25)
ON, ALONG = (0.5, 0.0, BOARD_Z + 0.004), (0.5, -0.12, BOARD_Z - 0.006)
IN_THE_WAY = Obstacle((0.14, -0.13, 0.55), radius=0.05, stiffness=3000.0)
DELAYED = WorldConfig(plant=PlantConfig(torque_delay_ticks=1), sensors=NO_NOISE)


@pytest.mark.parametrize("kind", [NominalBackend, PublicMujoco, BulletBackend])
def test_backends_have_the_contracts_methods(kind):
    methods = [name for name, _ in inspect.getmembers(Backend, inspect.isfunction) if not name.startswith("_")]
    assert methods == ["close", "place_fixture", "read", "reset", "set_tip_friction", "step", "write"]
    for name in methods:
        assert hasattr(kind, name) or name == "close"  # PyBullet's is made with its client


def busy_worlds(preset, backend=None):
    """The tip lands on a plate and goes along it, the forearm meets an obstacle, and somebody pushes link 4."""
    worlds = worlds_at(ON, WorldConfig(obstacles=(IN_THE_WAY,)), preset, seed=3, backend=backend)
    aim(worlds, ALONG)
    worlds.push(0, "link4", (0.0, 0.05, 0.0), (0.0, 20.0, 5.0), 0.3, 0.5)
    return worlds


def same_but_for_sizes(name, theirs, mine):
    """Compare to the bit; sizes of forces, which nothing goes on from, to one: a sum of squares may be fused or not."""
    if name in ("obstacle_force", "obstacle_force_peak"):
        assert_allclose(theirs, mine, rtol=1e-14, atol=0.0, err_msg=name)
    else:
        assert_array_equal(theirs, mine, err_msg=name)


@pytest.mark.parametrize("preset", ["vices", "safe"])
def test_the_compiled_form_is_mujocos_public_api_to_the_bit(preset):
    compiled, by_hand = busy_worlds(preset), busy_worlds(preset, PublicMujoco)
    traces = [run(worlds, 36 * MAX_TICKS)[0] for worlds in (compiled, by_hand)]
    for name in traces[0].dtype.names:
        same_but_for_sizes(name, traces[1][name], traces[0][name])
    mine, theirs = compiled.datas[0], by_hand.backends[0].data
    for name in ("qpos", "qvel", "ctrl", "qfrc_applied", "sensordata"):
        assert_array_equal(getattr(theirs, name), getattr(mine, name), err_msg=name)
    for name in compiled.metrics.dtype.names:
        same_but_for_sizes(name, by_hand.metrics[name], compiled.metrics[name])
    assert_array_equal(by_hand.samples, compiled.samples)
    assert np.linalg.norm(traces[0]["tool_force"], axis=1).max() > 1.0
    assert traces[0]["obstacle_force"].max() > 1.0
    assert np.abs(traces[0]["tau_arm"]).max() > 1.0


def moved(config, backend, preset="safe", ticks=1000):
    worlds = worlds_at(START, config, preset, backend=backend)
    aim(worlds, GOAL)
    trace = run(worlds, ticks)[0]
    worlds.close()
    return trace


@pytest.mark.parametrize("preset", ["vices", "safe"])
def test_free_motion_is_that_of_the_nominal_dynamics(preset):
    """30 cm in a second: the joints agree to 1 µrad, the torques to 10 µN m; MuJoCo's tool is a tick late."""
    mujoco, nominal = (moved(CALM, backend, preset) for backend in (None, NominalBackend))
    assert np.linalg.norm(mujoco["position"][-1] - mujoco["position"][0]) > 0.25
    assert_allclose(nominal["q"], mujoco["q"], rtol=0, atol=1e-6)
    assert_allclose(nominal["torque"], mujoco["torque"], rtol=0, atol=1e-5)
    assert_allclose(nominal["position"][:-1], mujoco["position"][1:], rtol=0, atol=1e-6)


def test_friction_of_the_plant_is_felt_in_every_backend():
    slippery = replace(CALM, plant=PlantConfig(friction_scale=0.0))
    for backend in (None, NominalBackend):
        assert np.abs(moved(slippery, backend)["q"] - moved(CALM, backend)["q"]).max() > 1e-3


def told(config, backend, ticks=30):
    """What reaches the controller less the truth before the tick, and what the motors do less the command."""
    worlds = worlds_at(START, config, backend=backend)
    record, controller = worlds.records[0], worlds.controllers[0]
    rows = []
    for _ in range(ticks):
        before = [record["truth"][name].copy() for name in ("q", "qd")]
        run(worlds, 1)
        errors = [controller["measurement"][name] - true for name, true in zip(("q", "qd"), before, strict=True)]
        rows.append([*errors, record["motor"] - controller["output"]["torque"], controller["measurement"]["wrench_ee"]])
    return [np.array(column) for column in zip(*rows, strict=True)]


@pytest.mark.parametrize("sensors", [SensorConfig(), SensorConfig(q_rad=1e-3, torque_nm=0.5, force_bias_n=2.0)])
def test_sensors_and_motors_have_the_same_errors_in_every_backend(sensors):
    """One seed, one noise: to the rounding of what it is added to; the wrench, to what MuJoCo's sensors compute."""
    config = WorldConfig(sensors=sensors)
    for mine, theirs, tolerance in zip(
        told(config, None), told(config, NominalBackend), (1e-14, 1e-14, 1e-12, 0.02), strict=True
    ):
        assert np.abs(mine).max() > 0.0
        assert_allclose(theirs, mine, rtol=0, atol=tolerance)


def test_encoders_and_filtered_velocity_are_the_same_in_every_backend():
    readings = []
    for backend in (None, NominalBackend):
        worlds = worlds_at(
            START, WorldConfig(sensors=replace(REAL_SENSORS, torque_nm=0.0, force_n=0.0)), backend=backend
        )
        aim(worlds, GOAL)
        run(worlds, 200)
        readings.append(worlds.controllers[0]["measurement"]["qd"].copy())
        worlds.close()
    assert np.abs(readings[0]).max() > 0.1
    assert_allclose(readings[1], readings[0], rtol=0, atol=0.02)


@pytest.mark.parametrize("backend", [None, NominalBackend, PublicMujoco])
def test_a_delayed_torque_arrives_one_tick_later_in_every_backend(backend):
    worlds = worlds_at(START, DELAYED, backend=backend)
    aim(worlds, GOAL)
    last = worlds.records[0]["errors"]["tau_delayed"].copy()
    for _ in range(20):
        run(worlds, 1)
        assert_array_equal(worlds.records[0]["motor"], last)
        last = worlds.controllers[0]["output"]["torque"].copy()


@pytest.mark.parametrize("backend", [NominalBackend, PublicMujoco])
def test_pictures_show_the_arm_where_the_backend_has_it(backend):
    worlds = worlds_at(START, backend=backend)
    aim(worlds, GOAL)
    run(worlds, 300)
    assert_array_equal(worlds.datas[0].qpos[:7], worlds.records[0]["truth"]["q"])
    assert_allclose(worlds.datas[0].site("tcp").xpos, panda().tool_pose(worlds.datas[0].qpos[:7]).position, atol=1e-9)


def test_reset_leaves_nothing_behind_in_any_backend():
    worlds, traces = worlds_at(START, backend=NominalBackend), []
    for _ in range(2):
        worlds.reset(0, posture(START))
        aim(worlds, GOAL)
        traces.append(run(worlds, 100)[0])
    assert_array_equal(traces[0], traces[1])


def test_many_worlds_in_a_backend_are_as_many_single_worlds():
    many = worlds_at(START, n=2, backend=NominalBackend)
    aim(many, GOAL, 1)
    together, alone = run(many, 100), moved(CALM, NominalBackend, ticks=100)
    assert_array_equal(together["q"][1], alone["q"])
    assert np.abs(together["q"][0, -1] - together["q"][0, 0]).max() < 1e-3


def test_a_backend_refuses_what_it_cannot_do():
    with pytest.raises(InvalidInputError, match="1 obstacles asked for; the nominal dynamics meet none"):
        worlds_at(START, replace(CALM, obstacles=(bottle((0.4, 0.0, 0.3)),)), backend=NominalBackend)
    worlds = worlds_at(START, backend=NominalBackend)
    worlds.push(0, "link4", (0.0, 0.0, 0.0), (0.0, 20.0, 0.0), 0.0, 0.1)
    with pytest.raises(InvalidInputError, match="a push is asked for; the nominal dynamics know none"):
        run(worlds, 1)
