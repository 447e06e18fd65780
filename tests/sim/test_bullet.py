"""PyBullet as a backend: its arm is the nominal one, its plate pushes back with the force it is pushed with."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.sim.scenes import BOARD_Z, CALM, aim, panda, posture, run, worlds_at

from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.bullet_backend import BulletBackend, import_pybullet
from contactsafe.sim.config import PlantConfig, WorldConfig
from contactsafe.sim.fixtures import workbench
from contactsafe.sim.obstacles import bottle
from contactsafe.sim.record import world_dtype
from contactsafe.sim.worlds import TICK_S

pytest.importorskip("pybullet")

FAR_BELOW = replace(CALM, fixtures=(workbench((0.5, 0.0, -2.0)),))
"""No posture of the arm meets the table."""


def postures(n, seed=0):
    arm = panda()
    fraction = np.random.default_rng(seed).uniform(0.1, 0.9, (n, arm.n))
    return arm.q_min + fraction * (arm.q_max - arm.q_min)


def accelerated(plant, q, torque):
    """Run one tick from rest at q under a torque, (7,), N m; joint velocities after it, (7,), rad/s."""
    world = np.zeros(1, dtype=world_dtype(7))[0]
    world["motor"] = torque
    plant.reset(q)
    plant.write(world)
    plant.step()
    plant.read(world)
    return world["truth"]["qd"]


def test_gravity_torque_keeps_the_arm_where_it_is():
    plant = BulletBackend(panda(), FAR_BELOW, TICK_S)
    for q in postures(20):
        qd = accelerated(plant, q, panda().dynamics(q, np.zeros(7))["g"])
        assert_allclose(qd / TICK_S, 0.0, atol=1e-3)  # rad/s²; without that torque up to 200


def test_torque_accelerates_the_arm_as_the_nominal_inertia_says():
    """Rotors included: without them joint 7 would start twenty times as fast."""
    plant, rng = BulletBackend(panda(), FAR_BELOW, TICK_S), np.random.default_rng(1)
    for q in postures(20):
        dynamics, tau = panda().dynamics(q, np.zeros(7)), rng.uniform(-1, 1, 7)
        qd = accelerated(plant, q, dynamics["g"] + tau)
        wanted = dynamics["M_inv"] @ tau
        assert_allclose(qd / TICK_S, wanted, atol=0.004 * np.abs(wanted).max())


@pytest.mark.parametrize("error", [PlantConfig(inertia_scale=1.2), PlantConfig(payload_kg=0.5)])
def test_an_arm_heavier_than_believed_sinks(error):
    q = panda().home
    plant = BulletBackend(panda(), replace(FAR_BELOW, plant=error), TICK_S)
    dynamics = panda().dynamics(q, np.zeros(7))
    assert (dynamics["J"] @ accelerated(plant, q, dynamics["g"]))[2] / TICK_S < -0.5  # m/s²


@pytest.mark.parametrize("config", [CALM, WorldConfig()], ids=["calm", "noisy"])
def test_the_controller_holds_a_pose_and_feels_nothing(config):
    worlds = worlds_at((0.5, 0.0, 0.06), config, backend=BulletBackend)
    trace = run(worlds, 1000)[0]
    assert np.abs(trace["error"][:, :3]).max() < 2e-4
    bias = worlds.records[0]["errors"]["wrench_bias"]
    assert_allclose(trace["wrench_ee"].mean(axis=0)[2], -bias[2], atol=0.02)  # the tool points down
    assert trace["wrench_ee"].std(axis=0)[:3].max() < 0.12
    assert not trace["tau_arm"].any()


def test_free_motion_is_the_same_in_both_engines():
    paths = []
    for backend in (None, BulletBackend):
        worlds = worlds_at((0.5, -0.1, 0.06), WorldConfig(), backend=backend)
        aim(worlds, (0.45, 0.15, 0.1))
        paths.append(run(worlds, 1000)[0])
    assert np.linalg.norm(paths[0]["position"][-1] - paths[0]["position"][0]) > 0.2
    assert_allclose(paths[1]["q"], paths[0]["q"], atol=1e-3)
    # MuJoCo leaves the tool where it was before the tick.
    assert_allclose(paths[1]["position"][:-1], paths[0]["position"][1:], atol=2e-4)


def test_the_plate_pushes_back_with_the_force_of_the_press():
    """At rest the motors' torque, gravity and the plate's force through the tool's Jacobian are in balance."""
    worlds = worlds_at((0.5, 0.0, BOARD_Z + 0.001), backend=BulletBackend)
    forces = []
    for depth in (0.002, 0.005, 0.01):
        aim(worlds, (0.5, 0.0, BOARD_Z - depth))
        row = run(worlds, 1200)[0][-1]
        dynamics = panda().dynamics(row["q"], np.zeros(7))
        assert_allclose(row["torque"] - dynamics["g"] + dynamics["J"].T @ row["wrench_ee"], 0.0, atol=0.01)
        assert_allclose(row["tool_force"], row["wrench_ee"][:3], atol=1e-4)
        assert_allclose(row["residual"], 0.0, atol=0.01)
        assert_allclose(row["tau_arm"], 0.0, atol=1e-6)
        forces.append(row["tool_force"][2])
    assert 2.0 < forces[0] < forces[1] < forces[2] < 25.0


def test_the_tip_is_as_stiff_as_in_mujoco():
    worlds = worlds_at((0.5, 0.0, BOARD_Z + 0.001), backend=BulletBackend)
    aim(worlds, (0.5, 0.0, BOARD_Z - 0.01))
    row = run(worlds, 1200)[0][-1]
    assert_allclose(row["tool_force"][2] / (BOARD_Z - row["position"][2]), 4 * 4800.0, rtol=0.05)


def test_friction_is_its_coefficient_times_the_press_and_against_the_motion():
    worlds = worlds_at((0.5, -0.05, BOARD_Z + 0.001), backend=BulletBackend)
    aim(worlds, (0.5, -0.05, BOARD_Z - 0.006))
    run(worlds, 800)
    aim(worlds, (0.5, 0.1, BOARD_Z - 0.006))
    trace = run(worlds, 500)[0][150:350]
    moving = np.diff(trace["position"][:, 1]) > 2e-5
    assert moving.mean() > 0.9
    across, press = trace["tool_force"][1:, :2][moving], trace["tool_force"][1:, 2][moving]
    assert_allclose(np.linalg.norm(across, axis=1), 0.3 * press, rtol=0.05)
    assert (across[:, 1] < 0).all()


def test_any_part_but_the_tip_on_the_table_is_told():
    worlds = worlds_at((0.5, 0.0, BOARD_Z - 0.0005), backend=BulletBackend)
    run(worlds, 17)
    assert worlds.metrics[0]["contact_ticks"] > 0
    assert worlds.metrics[0]["arm_touched"] == 0
    worlds.reset(0, np.array([0.0, 1.55, 0.0, -0.6, 0.0, 2.6, 0.8]))  # on its elbow
    worlds.controllers[0]["target"]["position"][2] -= 0.2
    run(worlds, 510)
    assert worlds.metrics[0]["arm_touched"] == 1


def test_a_push_on_a_link_is_felt_by_the_observer():
    worlds = worlds_at((0.5, 0.0, 0.15), backend=BulletBackend)
    worlds.push(0, "link5", (0.0, 0.0, 0.0), (0.0, 15.0, 0.0), 0.0, 1.0)
    trace = run(worlds, 100)[0]
    assert np.abs(trace["tau_arm"][-1]).max() > 2.0
    assert_allclose(trace["residual_fast"][-1], trace["tau_arm"][-1], atol=0.25 * np.abs(trace["tau_arm"][-1]).max())


def test_after_a_reset_everything_is_as_new():
    worlds = worlds_at((0.5, 0.0, BOARD_Z), WorldConfig(), backend=BulletBackend)
    traces = []
    for _ in range(2):
        worlds.seed(3)
        worlds.reset(0, posture((0.5, 0.0, BOARD_Z + 0.002)))
        aim(worlds, (0.55, 0.05, BOARD_Z - 0.005))
        traces.append(run(worlds, 170))
    assert_array_equal(traces[0], traces[1])
    assert traces[0]["tool_force"].any()


def test_obstacles_are_refused():
    config = replace(CALM, obstacles=(bottle((0.4, 0.0, 0.3)),))
    with pytest.raises(InvalidInputError) as caught:
        BulletBackend(panda(), config, TICK_S)
    assert str(caught.value) == "1 obstacles asked for; the PyBullet engine has none, take the MuJoCo engine"


def test_without_pybullet_the_remedy_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(InvalidInputError) as caught:
        import_pybullet()
    assert str(caught.value) == (
        "the second engine needs pybullet, which is not installed; run: pip install 'contactsafe[pybullet]'"
    )
