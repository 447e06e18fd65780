"""Sensors at the joints as real arms have them, and dry friction before them."""

import numpy as np
import pytest
from tests.sim.scenes import BOARD_Z, aim, panda, run, worlds_at

from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.config import FRANKA_SENSORS, NO_NOISE, PlantConfig, SensorConfig, WorldConfig
from contactsafe.sim.worlds import Worlds

OVER = (0.5, 0.0, BOARD_Z + 0.06)


def measured(worlds, ticks=2000, goal=None):
    """Run tick by tick; give what the controller was told and what the plant was, each (ticks, 7)."""
    if goal is not None:
        aim(worlds, goal)
    seen = {name: [] for name in ("q", "qd", "torque", "plant_qd", "motor", "drag")}
    for _ in range(ticks):
        before = worlds.records[0]["truth"]["qd"].copy()
        motor, drag = worlds.records[0]["motor"].copy(), worlds.records[0]["drag"].copy()
        worlds.run(1)
        measurement = worlds.controllers[0]["measurement"]
        for name, value in (("plant_qd", before), ("motor", motor), ("drag", drag)):
            seen[name].append(value)
        for name in ("q", "qd", "torque"):
            seen[name].append(measurement[name].copy())
    return {name: np.array(values) for name, values in seen.items()}


def test_velocity_is_noisy_in_its_band_and_nowhere_else():
    worlds = worlds_at(OVER, WorldConfig(sensors=FRANKA_SENSORS))
    seen = measured(worlds, 8000)
    noise = (seen["qd"] - seen["plant_qd"])[500:]
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(5e-3, rel=0.15)
    power = np.mean(np.abs(np.fft.rfft(noise, axis=0)) ** 2, axis=1)
    hz = np.fft.rfftfreq(len(noise), 1e-3)
    within = power[(hz > 5) & (hz < 50)].mean()
    assert power[hz > 250].mean() < 0.1 * within
    assert power[(hz > 0) & (hz < 1)].mean() < 0.2 * within


def test_the_measured_torque_is_the_motors_less_friction_and_what_the_rotors_take():
    world = WorldConfig(sensors=SensorConfig(**{**NO_NOISE.__dict__, "joint_torque": True}))
    worlds = worlds_at(OVER, world, preset="vices")
    seen = measured(worlds, 600, (0.5, 0.15, BOARD_Z + 0.1))
    rotor = worlds.arm.model.dof_armature
    acceleration = np.diff(seen["plant_qd"], axis=0) / 1e-3
    expected = (seen["motor"] - seen["drag"])[1:] - rotor * acceleration
    assert np.abs(rotor * acceleration).max() > 0.3
    np.testing.assert_allclose(seen["torque"][1:], expected, atol=1e-9)


def test_its_bias_stays_for_an_episode_and_its_play_hides_small_changes():
    sensors = SensorConfig(
        **{**NO_NOISE.__dict__, "joint_torque": True, "joint_torque_bias_nm": 0.3, "joint_torque_play_nm": 0.1}
    )
    worlds = worlds_at(OVER, WorldConfig(sensors=sensors))
    bias = worlds.records[0]["errors"]["joints"]["torque_bias"].copy()
    seen = measured(worlds, 1200, (0.5, 0.1, BOARD_Z + 0.1))
    off = seen["torque"] - seen["motor"] + seen["drag"] - bias
    assert 0.02 < np.std(bias) < 1.0
    assert np.abs(off[-200:]).max() < 0.15  # at rest again, within the play
    assert (worlds.records[0]["errors"]["joints"]["torque_bias"] == bias).all()
    worlds.reset(0, worlds.arm.home)
    assert (worlds.records[0]["errors"]["joints"]["torque_bias"] != bias).all()


def test_without_such_sensors_nothing_is_measured_of_the_joints_torque():
    plain = worlds_at(OVER)
    run(plain, 50)
    assert not plain.controllers[0]["measurement"]["has_torque"]
    blind = worlds_at(OVER, WorldConfig(sensors=SensorConfig(wrist=False)))
    run(blind, 50)
    assert not blind.controllers[0]["measurement"]["has_wrench"]
    assert not blind.controllers[0]["measurement"]["wrench_ee"].any()


def test_a_worlds_noise_depends_on_nothing_but_its_own_sensors():
    """Beside a world with more sensors it is what it is alone."""
    alone = Worlds(panda(), WorldConfig(), seed=[5])
    beside = Worlds(panda(), [WorldConfig(), WorldConfig(sensors=FRANKA_SENSORS)], n=2, seed=[5, 6])
    np.testing.assert_array_equal(beside.sample_noise()[0, :, :30], alone.sample_noise()[0])
    for worlds in (alone, beside):
        worlds.close()


@pytest.mark.parametrize("stiction", [1.0, (1.1, 0.8, 0.8, 0.8, 0.4, 0.4, 0.25)])
def test_stiction_holds_a_joint_against_less_than_itself_and_brakes_it_beyond(stiction):
    world = WorldConfig(sensors=NO_NOISE, plant=PlantConfig(stiction_nm=stiction, friction_scale=0.0))
    worlds = worlds_at(OVER, world)
    seen = measured(worlds, 1500, (0.5, 0.15, BOARD_Z + 0.1))
    limit = np.broadcast_to(np.asarray(stiction, float), (7,))
    assert (np.abs(seen["drag"]) <= limit + 1e-12).all()
    fast = np.abs(seen["plant_qd"]) > 0.05
    slid = fast[20:] & fast[:-20] & (np.sign(seen["plant_qd"][20:]) == np.sign(seen["plant_qd"][:-20]))
    ratio = (seen["drag"] * np.sign(seen["plant_qd"]) / limit)[20:][slid]
    assert len(ratio) > 50
    assert np.median(ratio) > 0.7


def test_motors_that_are_off_by_less_than_stiction_move_nothing():
    """What a controller without integral leaves of an unknown load stays away under stiction."""

    def sagged(stiction):
        plant = PlantConfig(stiction_nm=stiction, friction_scale=0.0, payload_kg=0.05)
        worlds = worlds_at(OVER, WorldConfig(sensors=NO_NOISE, plant=plant))
        start = worlds.records[0]["truth"]["q"].copy()
        run(worlds, 1500)
        return np.abs(worlds.records[0]["truth"]["q"] - start).max()

    assert sagged(1.0) < 0.7 * sagged(0.0)


@pytest.mark.parametrize("stiction", [-1.0, np.inf, (1.0, -0.1, 1.0, 1.0, 1.0, 1.0, 1.0)])
def test_stiction_that_drives_is_refused(stiction):
    with pytest.raises(InvalidInputError, match="stiction_nm"):
        PlantConfig(stiction_nm=stiction)
