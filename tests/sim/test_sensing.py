"""What reaches the controller: a compensated wrist wrench, joints with noise of the stated size, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.sim.scenes import BOARD_Z, CALM, aim, contact_wrench, panda, posture, run, worlds_at

from contactsafe.control.tick import tick_at
from contactsafe.sim.config import NO_NOISE, PlantConfig, SensorConfig, WorldConfig
from contactsafe.sim.records import noise_channels
from contactsafe.sim.stepping import sense

OVER, ON = (0.5, 0.0, BOARD_Z + 0.06), (0.5, 0.0, BOARD_Z + 0.0005)


@pytest.mark.parametrize("depth", [0.003, 0.008, 0.015])
def test_pressed_at_rest_the_wrist_reads_the_contact(depth):
    worlds = worlds_at(ON)
    aim(worlds, (0.5, 0.0, BOARD_Z - depth))
    trace = run(worlds, 1500)[0]
    point = worlds.controllers[0]["output"]["position"]
    true = contact_wrench(worlds.models[0], worlds.datas[0], "pad", point)
    assert true[2] > 2.0
    assert_allclose(trace["tool_force"][-1], true[:3], rtol=0, atol=1e-9)
    assert np.abs(trace["wrench_ee"][-100:, :3] - trace["tool_force"][-100:]).max() < 0.1
    assert_allclose(trace["wrench_ee"][-1, 3:], true[3:], rtol=0, atol=0.02)


def test_in_free_air_the_tool_weighs_nothing_however_it_moves():
    """Swept to and fro by 15 cm, up to 0.4 m/s and a few m/s²: weight and inertia are taken out to 0.5 N."""
    worlds = worlds_at((0.5, 0.0, BOARD_Z + 0.1), preset="vices")
    tool_mass = panda().tool.inertia.mass
    forces, positions = [], []
    for goal in (0.15, -0.15, 0.1):
        aim(worlds, (0.5, goal, BOARD_Z + 0.15), stiffness=100.0)
        trace = run(worlds, 700)[0]
        forces.append(trace["wrench_ee"][:, :3])
        positions.append(trace["position"])
    acceleration = np.diff(np.concatenate(positions), 2, axis=0) * 1e6
    assert np.abs(acceleration).max() > 3.0
    assert tool_mass * np.abs(acceleration).max() > 2.0  # what an uncompensated sensor would show, beside the weight
    assert np.linalg.norm(np.concatenate(forces), axis=1).max() < 0.5


def test_at_rest_an_unknown_payload_shows_as_its_weight_not_as_nothing():
    """The compensation knows the nominal tool only."""
    config = WorldConfig(sensors=NO_NOISE, plant=PlantConfig(payload_kg=0.2))
    trace = run(worlds_at(OVER, config), 2000)[0]
    assert_allclose(trace["wrench_ee"][-1, :3], (0.0, 0.0, -0.2 * 9.81), atol=0.05)


def sensed(worlds, rows):
    """What the controller is told at one and the same state of the plant, again and again."""
    rng = np.random.default_rng(0)
    measurement = worlds.controllers[0]["measurement"]
    seen = {name: np.empty((rows, *measurement[name].shape)) for name in ("q", "qd", "wrench_ee")}
    for k in range(rows):
        sense(worlds.plants[0], worlds.controllers[0], rng.standard_normal(noise_channels(7)))
        for name, values in seen.items():
            values[k] = measurement[name]
    return seen


def test_noise_has_the_stated_deviation():
    sensors = replace(SensorConfig(), force_bias_n=0.0, moment_bias_nm=0.0)
    true = sensed(worlds_at(OVER), 1)
    seen = sensed(worlds_at(OVER, WorldConfig(sensors=sensors)), 4000)
    force = np.hypot(sensors.force_n, panda().tool.inertia.mass * sensors.accelerometer_m_s2)
    for name, deviation, columns in (
        ("q", sensors.q_rad, slice(None)),
        ("qd", sensors.qd_rad_s, slice(None)),
        ("wrench_ee", force, slice(0, 3)),
    ):
        error = (seen[name] - true[name])[:, columns]
        assert_allclose(error.std(axis=0), deviation, rtol=0.06, err_msg=name)
        assert np.abs(error.mean(axis=0)).max() < 5 * deviation / np.sqrt(4000), name


def test_torque_noise_is_what_lies_between_command_and_joint():
    worlds = worlds_at(OVER, WorldConfig(sensors=replace(NO_NOISE, torque_nm=0.05)))
    errors = []
    for _ in range(600):
        run(worlds, 1)
        errors.append(worlds.datas[0].ctrl - worlds.controllers[0]["output"]["torque"])
    assert_allclose(np.std(errors, axis=0), 0.05, rtol=0.15)


def test_bias_is_drawn_at_reset_and_stays():
    sensors = replace(NO_NOISE, force_bias_n=0.2, moment_bias_nm=0.01)
    worlds = worlds_at(OVER, WorldConfig(sensors=sensors))
    trace = run(worlds, 300)[0]
    bias = worlds.plants[0]["wrench_bias"].copy()
    assert_allclose(np.linalg.norm(trace["wrench_ee"][-1, :3]), np.linalg.norm(bias[:3]), rtol=0, atol=0.02)
    q, drawn = posture(OVER), []
    for _ in range(300):
        worlds.reset(0, q)
        drawn.append(worlds.plants[0]["wrench_bias"].copy())
    assert_allclose(np.std(drawn, axis=0), [0.2] * 3 + [0.01] * 3, rtol=0.15)


@pytest.mark.parametrize(
    "plant",
    [PlantConfig(friction_scale=3.0), PlantConfig(inertia_scale=1.5), PlantConfig(payload_kg=2.0)],
    ids=["friction", "inertia", "payload"],
)
def test_the_controllers_model_is_not_the_plant(plant):
    """The same measurement gives the same dynamics and the same torque, whatever the plant is made of."""
    seen = []
    for p in (PlantConfig(), plant):
        worlds = worlds_at(OVER, WorldConfig(plant=p, sensors=NO_NOISE))
        controller = worlds.controllers[0]
        sense(worlds.plants[0], controller, np.zeros(noise_channels(7)))
        controller["measurement"]["qd"], controller["measurement"]["wrench_ee"] = 0.1, 0.0
        tick_at(worlds.controllers, 0)
        seen.append((controller["dynamics"].copy(), controller["output"].copy()))
    for name in seen[0][0].dtype.names:
        assert_array_equal(seen[0][0][name], seen[1][0][name], err_msg=name)
    assert_array_equal(seen[0][1]["torque"], seen[1][1]["torque"])


def test_once_sensed_the_plant_may_change_unseen():
    torques = []
    for spoil in (False, True):
        worlds = worlds_at(OVER, CALM)
        sense(worlds.plants[0], worlds.controllers[0], np.zeros(noise_channels(7)))
        if spoil:
            data = worlds.datas[0]
            for name in ("qpos", "qvel", "xpos", "xmat", "sensordata", "qfrc_constraint", "cvel"):
                getattr(data, name)[:] = np.nan
            worlds.models[0].body_mass[:] = np.nan
        tick_at(worlds.controllers, 0)
        torques.append(worlds.controllers[0]["output"]["torque"].copy())
    assert_array_equal(*torques)
