"""What the simulator says of contacts, for rewards, metrics and tests: forces and their torques on the arm."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.sim.scenes import (
    BOARD_Z,
    CALM,
    aim,
    contact_torque,
    contact_wrench,
    panda,
    posture,
    run,
    worlds_at,
)  # fmt: skip

from contactsafe.core.errors import InvalidInputError
from contactsafe.robot.shape import arm_capsules
from contactsafe.sim.config import NO_NOISE, WorldConfig
from contactsafe.sim.obstacles import Obstacle, bottle, thrust_meter

OVER = (0.5, 0.0, BOARD_Z + 0.05)
RIGHT = (0.5, -0.15, BOARD_Z + 0.05)


def beside_forearm(make, y=-0.06):
    """Hold an obstacle where the forearm's side is when the tool is at y, m."""
    starts, ends, radii, links = arm_capsules(panda().description, panda().tool, posture((0.5, y, RIGHT[2]))[None])
    k = next(k for k in np.flatnonzero(links == 5) if radii[k] > 0.05)
    middle = (starts[0, k] + ends[0, k]) / 2
    return make(tuple(middle - (0.0, radii[k] + make((0, 0, 0)).radius, 0.0)))


def pressed(make, preset="vices", ticks=3000):
    """Move the tool to the right until the forearm leans on the obstacle."""
    obstacle = beside_forearm(make)
    worlds = worlds_at(OVER, WorldConfig(sensors=NO_NOISE, obstacles=(obstacle,)), preset)
    aim(worlds, RIGHT)
    return worlds, run(worlds, ticks)[0], obstacle


@pytest.mark.parametrize("make", [bottle, thrust_meter])
def test_at_rest_force_is_stiffness_times_displacement(make):
    worlds, trace, obstacle = pressed(make)
    last = trace[-1]
    displacement = last["obstacle_position"][0] - obstacle.position
    assert np.abs(worlds.datas[0].qvel[7:]).max() < 1e-3
    assert last["obstacle_force"] > 20.0
    assert_allclose(last["obstacle_force"], obstacle.stiffness * np.linalg.norm(displacement), rtol=0.02)
    force = contact_wrench(worlds.models[0], worlds.datas[0], "obstacle0", np.zeros(3))[:3]
    assert_allclose(force, obstacle.stiffness * displacement, rtol=0.02, atol=0.2)


@pytest.mark.parametrize("make", [bottle, thrust_meter])
def test_tau_arm_is_the_obstacles_contact_through_its_jacobian(make):
    """At every stage: before, at the impact, and leaning."""
    obstacle = beside_forearm(make)
    worlds = worlds_at(OVER, WorldConfig(sensors=NO_NOISE, obstacles=(obstacle,)), "vices")
    aim(worlds, RIGHT)
    largest = 0.0
    for _ in range(100):
        row = run(worlds, 17)[0, -1]
        true = contact_torque(worlds.models[0], worlds.datas[0], "obstacle0")
        largest = max(largest, np.abs(true).max())
        assert_allclose(row["tau_arm"], true, rtol=1e-6, atol=1e-9)
    assert largest > 3.0


def test_tau_arm_is_the_obstacles_alone_while_the_tip_presses_too():
    obstacle = beside_forearm(bottle)
    worlds = worlds_at((0.5, 0.0, BOARD_Z + 0.0005), WorldConfig(sensors=NO_NOISE, obstacles=(obstacle,)), "vices")
    aim(worlds, (0.5, -0.15, BOARD_Z - 0.008))
    row = run(worlds, 2500)[0, -1]
    assert np.linalg.norm(row["tool_force"]) > 3.0
    assert row["obstacle_force"] > 3.0
    true = contact_torque(worlds.models[0], worlds.datas[0], "obstacle0")
    assert_allclose(row["tau_arm"], true, rtol=0, atol=1e-6)


def test_the_tip_alone_is_no_contact_of_the_arm():
    worlds = worlds_at((0.5, 0.0, BOARD_Z + 0.0005))
    aim(worlds, (0.5, 0.06, BOARD_Z - 0.01))
    trace = run(worlds, 1500)[0]
    assert np.linalg.norm(trace["tool_force"], axis=1).max() > 5.0
    assert np.abs(trace["tau_arm"]).max() < 1e-6


def test_a_push_is_its_jacobian_transposed():
    point, force = np.array([0.0, 0.0, -0.2]), np.array([12.0, -20.0, 5.0])
    worlds = worlds_at(OVER)
    worlds.push(0, "link5", point, force, 0.1, 0.6, ramp_s=0.05)
    assert_allclose(run(worlds, 399)[0]["tau_arm"][:100], 0.0, atol=1e-12)
    model, data = worlds.models[0], worlds.datas[0]
    body = model.body("link5").id
    J = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, J, np.zeros_like(J), data.xpos[body] + data.xmat[body].reshape(3, 3) @ point, body)
    # A tick's push is applied at the places that MuJoCo knows when the tick begins.
    assert_allclose(run(worlds, 1)[0]["tau_arm"][-1], J.T @ force, rtol=1e-9, atol=1e-12)
    assert_allclose(run(worlds, 250)[0]["tau_arm"][-1], 0.0, atol=1e-12)


def test_a_push_rises_and_falls_when_it_should():
    worlds = worlds_at(OVER)
    worlds.push(0, "link4", (0.0, 0.0, 0.0), (0.0, 10.0, 0.0), 0.1, 0.2, ramp_s=0.02)
    size = np.abs(run(worlds, 300)[0]["tau_arm"]).max(axis=1)
    assert_allclose(size[[109, 199]] / size[119], (0.5, 1.0), rtol=0.05)
    assert np.flatnonzero(size)[[0, -1]].tolist() == [100, 199]


def test_what_hits_nothing_feels_nothing():
    far = Obstacle((0.0, 0.8, 0.5), radius=0.05, stiffness=2000.0)
    trace = run(worlds_at(OVER, WorldConfig(sensors=NO_NOISE, obstacles=(far,))), 500)[0]
    assert trace["obstacle_force"].max() == 0.0
    assert_allclose(trace["obstacle_position"][-1, 0], far.position, atol=1e-9)
    assert CALM.obstacles == ()


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        (
            {"radius": 0.03, "stiffness": 2e3, "mass": 1e-4},
            "obstacle mass = 0.0001 kg; give 0.1 kg or more, lighter ones hardly push back",
        ),
        (
            {"radius": 0.0, "stiffness": 2e3},
            "obstacle radius = 0.0 m, stiffness = 2000.0 N/m; both must be greater than 0",
        ),
        (
            {"radius": 0.03, "stiffness": math.inf, "travel": (0.1, 0.0, 0.0)},
            "obstacle travels (0.1, 0.0, 0.0) m in (0.0, 1.0) s with stiffness inf N/m; "
            "give a finite stiffness, and a time of arrival after that of departure",
        ),
        (
            {"radius": 0.03, "stiffness": 2e3, "travel": (0.1, 0.0, 0.0), "travel_s": (1.0, 1.0)},
            "obstacle travels (0.1, 0.0, 0.0) m in (1.0, 1.0) s with stiffness 2000.0 N/m; "
            "give a finite stiffness, and a time of arrival after that of departure",
        ),
    ],
)
def test_obstacles_that_cannot_be_are_refused(fields, text):
    with pytest.raises(InvalidInputError) as caught:
        Obstacle((0.0, 0.0, 0.0), **fields)
    assert str(caught.value) == text


def pole(place):
    """Return a thing that cannot move."""
    return Obstacle(place, radius=0.035, stiffness=math.inf, half_length=0.09)


def test_a_fixed_obstacle_does_not_move_whatever_leans_on_it():
    worlds, trace, obstacle = pressed(pole)
    assert worlds.models[0].nv == 7
    assert trace["obstacle_force"].max() > 20.0
    assert_array_equal(trace["obstacle_position"][:, 0], np.broadcast_to(obstacle.position, (3000, 3)))
    true = contact_torque(worlds.models[0], worlds.datas[0], "obstacle0")
    assert_allclose(trace[-1]["tau_arm"], true, rtol=1e-6, atol=1e-6)


FAR, ARRIVED = (0.0, 0.8, 0.5), (0.1, 0.75, 0.52)


def travelling(travel=(0.1, -0.05, 0.02), travel_s=(0.2, 0.7)):
    return Obstacle(FAR, radius=0.05, stiffness=2e4, damping_ratio=1.0, travel=travel, travel_s=travel_s)


def test_an_obstacle_travels_its_displacement_in_its_time_and_stays_there():
    """At constant speed; on its springs it comes to rest within 0.1 mm of where it is held."""
    worlds = worlds_at(OVER, WorldConfig(sensors=NO_NOISE, obstacles=(travelling(),)))
    moved = run(worlds, 1500)[0]["obstacle_position"][:, 0] - np.array(FAR)
    assert_allclose(moved[:200], 0.0, atol=1e-9)
    assert_allclose(moved[450], np.array((0.1, -0.05, 0.02)) / 2, atol=0.004)
    assert_allclose(moved[-1], (0.1, -0.05, 0.02), atol=1e-4)
    assert np.abs(np.diff(moved, axis=0)).max() < 0.1 / 500 * 1.05


def test_reset_puts_a_travelling_obstacle_back():
    worlds = worlds_at(OVER, WorldConfig(sensors=NO_NOISE, obstacles=(travelling(),)))
    first = run(worlds, 900)[0]["obstacle_position"].copy()
    worlds.reset(0, posture(OVER))
    assert_array_equal(run(worlds, 900)[0]["obstacle_position"], first)


def test_worlds_of_one_configuration_do_not_share_what_travels():
    worlds = worlds_at(OVER, WorldConfig(sensors=NO_NOISE, obstacles=(travelling(),)), n=2)
    run(worlds, 900)
    worlds.reset(0, posture(OVER))
    trace = run(worlds, 17)
    assert_allclose(trace["obstacle_position"][0, -1, 0], FAR, atol=1e-9)
    assert_allclose(trace["obstacle_position"][1, -1, 0], ARRIVED, atol=1e-3)
    worlds.close()


def test_a_travelling_obstacle_beside_one_that_stays_moves_alone():
    beside = Obstacle((0.0, -0.8, 0.5), radius=0.05, stiffness=2e3)
    worlds = worlds_at(OVER, WorldConfig(sensors=NO_NOISE, obstacles=(beside, travelling())))
    last = run(worlds, 1500)[0]["obstacle_position"][-1]
    assert_allclose(last[0], beside.position, atol=1e-9)
    assert_allclose(last[1], ARRIVED, atol=1e-4)


def test_an_obstacle_stops_for_good_once_it_presses_with_its_limit_and_starts_anew_after_reset():
    resting = beside_forearm(bottle, y=0.0)
    away = np.array(resting.position) - (0.0, 0.03, 0.0)
    thing = replace(resting, position=tuple(away), travel=(0.0, 0.08, 0.0), travel_s=(0.1, 1.1), travel_until_n=4.0)
    worlds = worlds_at(OVER, WorldConfig(sensors=NO_NOISE, obstacles=(thing,)), "vices")
    first = run(worlds, 1500)[0].copy()
    assert first["obstacle_force"].max() > 4.0
    assert first["obstacle_force"][-300:].mean() < 8.0
    worlds.reset(0, posture(OVER))
    assert_array_equal(run(worlds, 1500)[0]["obstacle_position"], first["obstacle_position"])


def test_an_obstacle_that_travels_into_the_arm_pushes_it():
    resting = beside_forearm(bottle, y=0.0)
    away = np.array(resting.position) - (0.0, 0.03, 0.0)
    thing = replace(resting, position=tuple(away), travel=(0.0, 0.05, 0.0), travel_s=(0.1, 0.6))
    worlds = worlds_at(OVER, WorldConfig(sensors=NO_NOISE, obstacles=(thing,)), "vices")
    trace = run(worlds, 1500)[0]
    assert trace["obstacle_force"][:100].max() == 0.0
    assert trace["obstacle_force"][-1] > 5.0


def test_a_world_has_room_for_four_obstacles():
    with pytest.raises(InvalidInputError) as caught:
        WorldConfig(obstacles=(bottle((0.0, 0.0, 0.0)),) * 5)
    assert str(caught.value) == "5 obstacles asked for; a world holds at most 4"
