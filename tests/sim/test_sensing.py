"""What reaches the controller: a compensated wrist wrench, joints with noise of the stated size, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.sim.scenes import BOARD_Z, CALM, aim, contact_wrench, panda, posture, run, worlds_at

from contactsafe.control.tick import tick_at
from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.config import NO_NOISE, REAL_SENSORS, PlantConfig, SensorConfig, WorldConfig
from contactsafe.sim.scene import build_plant
from contactsafe.sim.sensing import noise_channels, sense

OVER, ON = (0.5, 0.0, BOARD_Z + 0.06), (0.5, 0.0, BOARD_Z + 0.0005)


@pytest.mark.parametrize("depth", [0.003, 0.008, 0.015])
def test_pressed_at_rest_the_wrist_reads_the_contact(depth):
    worlds = worlds_at(ON)
    aim(worlds, (0.5, 0.0, BOARD_Z - depth))
    trace = run(worlds, 1500)[0]
    point = worlds.controllers[0]["output"]["position"]
    true = contact_wrench(worlds.models[0], worlds.datas[0], "tip", point)
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
        sense(worlds.records[0], worlds.controllers[0], rng.standard_normal(noise_channels(7)))
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
    bias = worlds.records[0]["errors"]["wrench_bias"].copy()
    assert_allclose(np.linalg.norm(trace["wrench_ee"][-1, :3]), np.linalg.norm(bias[:3]), rtol=0, atol=0.02)
    q, drawn = posture(OVER), []
    for _ in range(300):
        worlds.reset(0, q)
        drawn.append(worlds.records[0]["errors"]["wrench_bias"].copy())
    assert_allclose(np.std(drawn, axis=0), [0.2] * 3 + [0.01] * 3, rtol=0.15)


@pytest.mark.parametrize(
    "plant",
    [
        PlantConfig(friction_scale=3.0),
        PlantConfig(friction_scale=(3.0, 1.0, 0.0, 1.0, 1.0, 2.0, 1.0)),
        PlantConfig(inertia_scale=1.5),
        PlantConfig(inertia_scale=(1.0, 1.0, 0.8, 1.2, 1.0, 1.0, 1.5)),
        PlantConfig(payload_kg=2.0),
        PlantConfig(payload_kg=-0.4),
    ],
    ids=["friction", "joints' friction", "inertia", "links' inertia", "payload", "lighter tool"],
)
def test_the_controllers_model_is_not_the_plant(plant):
    """The same measurement gives the same dynamics and the same torque, whatever the plant is made of."""
    seen = []
    for p in (PlantConfig(), plant):
        worlds = worlds_at(OVER, WorldConfig(plant=p, sensors=NO_NOISE))
        controller = worlds.controllers[0]
        sense(worlds.records[0], controller, np.zeros(noise_channels(7)))
        controller["measurement"]["qd"], controller["measurement"]["wrench_ee"] = 0.1, 0.0
        tick_at(worlds.controllers, 0)
        seen.append((controller["dynamics"].copy(), controller["output"].copy()))
    for name in seen[0][0].dtype.names:
        assert_array_equal(seen[0][0][name], seen[1][0][name], err_msg=name)
    assert_array_equal(seen[0][1]["torque"], seen[1][1]["torque"])


def test_once_sensed_the_plant_may_change_unseen():
    torques = []
    for corrupt in (False, True):
        worlds = worlds_at(OVER, CALM)
        sense(worlds.records[0], worlds.controllers[0], np.zeros(noise_channels(7)))
        if corrupt:
            data = worlds.datas[0]
            for name in ("qpos", "qvel", "xpos", "xmat", "sensordata", "qfrc_constraint", "cvel"):
                getattr(data, name)[:] = np.nan
            worlds.models[0].body_mass[:] = np.nan
        tick_at(worlds.controllers, 0)
        torques.append(worlds.controllers[0]["output"]["torque"].copy())
    assert_array_equal(*torques)


def readings(worlds, ticks):
    """Run tick by tick; return measured positions, measured velocities and the plant's before each tick."""
    q, qd, true_q, true_qd = [], [], [], []
    for _ in range(ticks):
        true_q.append(worlds.datas[0].qpos[:7].copy())
        true_qd.append(worlds.datas[0].qvel[:7].copy())
        run(worlds, 1)
        measured = worlds.controllers[0]["measurement"]
        q.append(measured["q"].copy())
        qd.append(measured["qd"].copy())
    return tuple(map(np.array, (q, qd, true_q, true_qd)))


def sweeping(sensors):
    worlds = worlds_at(OVER, WorldConfig(sensors=sensors))
    aim(worlds, (0.5, 0.15, BOARD_Z + 0.1))
    return worlds


@pytest.mark.parametrize("step", [1e-5, 2 * np.pi / 2**13])
def test_encoders_give_whole_steps_and_the_nearest_one(step):
    q, _, true_q, _ = readings(sweeping(replace(NO_NOISE, encoder_step_rad=step)), 400)
    assert_allclose(q / step, np.round(q / step), rtol=0, atol=1e-6)
    assert np.abs(q - true_q).max() <= 0.5 * step * (1 + 1e-9)
    assert np.abs(q - true_q).max() > 0.4 * step


def test_filtered_velocity_is_the_low_passed_difference_of_what_the_encoders_say():
    """A first-order low-pass of the stated cut-off, at rest from the start."""
    sensors = replace(NO_NOISE, encoder_step_rad=1e-4, velocity_filter_hz=50.0)
    q, qd, *_ = readings(sweeping(sensors), 400)
    gain, expected = 1.0 - np.exp(-2 * np.pi * 50.0 * 0.001), np.zeros(7)
    for k in range(1, 400):
        expected = expected + gain * ((q[k] - q[k - 1]) / 0.001 - expected)
        assert_allclose(qd[k], expected, rtol=0, atol=1e-9)
    assert_array_equal(qd[0], 0.0)
    assert np.abs(qd).max() > 0.1


def test_filtered_velocity_lags_by_its_time_constant_and_no_more():
    """100 Hz: 1.1 ms; the plant moves by the speed it has at a tick's end. Once the first jerk is over."""
    _, qd, _, true_qd = (seen[50:] for seen in readings(sweeping(replace(NO_NOISE, velocity_filter_hz=100.0)), 800))
    assert np.abs(true_qd).max() > 0.2
    errors = [np.std(qd[lag:] - true_qd[: len(qd) - lag]) for lag in range(5)]
    assert np.argmin(errors) == 1
    assert errors[1] < 0.3 * errors[0]


def test_unfiltered_velocity_is_the_plants_own():
    _, qd, _, true_qd = readings(sweeping(NO_NOISE), 100)
    assert_array_equal(qd, true_qd)


def test_reset_makes_filtered_velocity_start_at_rest():
    worlds = sweeping(REAL_SENSORS)
    run(worlds, 300)
    assert np.abs(worlds.controllers[0]["measurement"]["qd"]).max() > 0.05
    worlds.reset(0, posture(OVER))
    run(worlds, 1)
    assert_array_equal(worlds.controllers[0]["measurement"]["qd"], 0.0)


def test_real_sensors_are_19_bit_encoders_and_a_low_pass():
    assert REAL_SENSORS.encoder_step_rad == 2 * np.pi / 2**19
    assert REAL_SENSORS.velocity_filter_hz == 100.0
    assert REAL_SENSORS.force_n == SensorConfig().force_n


def test_an_arm_with_real_sensors_reports_no_contact_while_it_moves_freely():
    worlds = worlds_at(OVER, WorldConfig(sensors=REAL_SENSORS))
    for goal in (0.12, -0.12):
        aim(worlds, (0.5, goal, BOARD_Z + 0.1))
        trace = run(worlds, 900)[0]
        assert not trace["mode"].any()
        assert np.linalg.norm(trace["error"][-1, :3]) < 0.01


def test_one_scale_is_the_same_for_every_link_and_one_each_is_each_links_own():
    nominal, scales = build_plant(panda(), WorldConfig()), (1.0, 0.9, 1.1, 1.2, 0.8, 1.05, 0.95)
    one = build_plant(panda(), WorldConfig(plant=PlantConfig(inertia_scale=1.3)))
    each = build_plant(panda(), WorldConfig(plant=PlantConfig(inertia_scale=scales)))
    for k in range(1, 8):
        for name in ("body_mass", "body_inertia"):
            before, same, own = (getattr(m, name)[m.body(f"link{k}").id] for m in (nominal, one, each))
            assert_allclose(same, 1.3 * before, rtol=1e-9)
            assert_allclose(own, scales[k - 1] * before, rtol=1e-9)
    for model in (one, each):
        assert model.body("tool").mass == nominal.body("tool").mass


def test_friction_of_each_joint_has_its_own_scale():
    scales = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
    plain, scaled = (
        worlds_at(OVER, WorldConfig(plant=PlantConfig(friction_scale=s), sensors=NO_NOISE)).records[0]["errors"][
            "friction"
        ]
        for s in (1.0, scales)
    )
    assert_array_equal(plain, panda().friction)
    assert_allclose(scaled[:, 0], np.array(scales) * plain[:, 0], rtol=1e-15)
    assert_array_equal(scaled[:, 1:], plain[:, 1:])


def test_a_lighter_tool_weighs_less_and_shows_so_at_the_wrist():
    config = WorldConfig(sensors=NO_NOISE, plant=PlantConfig(payload_kg=-0.3))
    worlds = worlds_at(OVER, config)
    nominal = build_plant(panda(), WorldConfig())
    assert_allclose(worlds.models[0].body("tool").mass, nominal.body("tool").mass - 0.3, rtol=1e-9)
    trace = run(worlds, 2000)[0]
    assert_allclose(trace["wrench_ee"][-1, :3], (0.0, 0.0, 0.3 * 9.81), atol=0.05)


@pytest.mark.parametrize(
    ("plant", "text"),
    [
        ({"inertia_scale": (1.0, 1.1)}, "inertia_scale has 2 numbers; give one, or one for each of 7 joints"),
        (
            {"payload_kg": -0.83},
            "payload_kg = -0.83 takes more than the 0.83 kg of tool 'franka hand with wiper'; give a larger one",
        ),
    ],
)
def test_plants_that_do_not_fit_the_arm_are_refused(plant, text):
    with pytest.raises(InvalidInputError) as caught:
        worlds_at(OVER, WorldConfig(plant=PlantConfig(**plant)))
    assert str(caught.value) == text


def test_friction_scales_that_do_not_fit_the_arm_are_refused():
    with pytest.raises(InvalidInputError) as caught:
        worlds_at(OVER, WorldConfig(plant=PlantConfig(friction_scale=(1.0,) * 6)))
    assert str(caught.value) == "friction_scale has 6 numbers; give one, or one for each of 7 joints"
