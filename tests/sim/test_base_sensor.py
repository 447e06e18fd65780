"""The sensor under the base shows weight, inertia and every contact, and nothing where it is absent."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe import presets, robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.sim.bullet_backend import BulletBackend
from contactsafe.sim.config import NO_NOISE, SensorConfig, WorldConfig
from contactsafe.sim.obstacles import Obstacle
from contactsafe.sim.truth import trace_dtype
from contactsafe.sim.worlds import Worlds

ARM = robots.panda()
EXACT = replace(NO_NOISE, base=True)


def worlds_with(sensors=EXACT, obstacles=(), seed=0):
    worlds = Worlds(ARM, WorldConfig(sensors=sensors, fixtures=(), obstacles=obstacles), presets.vices(), seed=seed)
    worlds.reset(0, ARM.home)
    return worlds


def played(worlds, ticks, each=None):
    """Run a world; give what its base and its arm did, a row a tick."""
    found = np.zeros((1, ticks), dtype=trace_dtype(ARM.n))
    for tick in range(ticks):
        if each is not None:
            each(tick)
        worlds.run(1, found[:, tick : tick + 1])
    return found[0]


def momentum_and_weight(data):
    """Give momentum and weight of all bodies about the world's origin, (6,) each."""
    model, momentum, weight, velocity = ARM.model, np.zeros(6), np.zeros(6), np.zeros(6)
    for body in range(1, model.nbody):
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        R, p = data.ximat[body].reshape(3, 3), model.body_mass[body] * velocity[3:]
        spin = R @ (model.body_inertia[body] * (R.T @ velocity[:3]))
        force = model.body_mass[body] * model.opt.gravity
        momentum += np.concatenate([p, spin + np.cross(data.xipos[body], p)])
        weight += np.concatenate([force, np.cross(data.xipos[body], force)])
    return momentum, weight


def state_of(q, qd):
    data = mujoco.MjData(ARM.model)
    data.qpos[:], data.qvel[:] = q, qd
    mujoco.mj_forward(ARM.model, data)
    return momentum_and_weight(data)


def test_an_arm_at_rest_shows_its_weight():
    worlds = worlds_with()
    seen = played(worlds, 300)["wrench_base"][-1]
    assert_allclose(seen, state_of(worlds.records[0]["truth"]["q"], np.zeros(ARM.n))[1], atol=0.1)
    assert seen[2] < -150.0


def test_motion_shows_as_what_it_takes_from_the_weight():
    """F = w − ṗ: over any time the impulse of the base is that of the weight less what momentum was gained."""
    worlds = worlds_with()
    held = worlds.controllers["state"]["target"]["position"][0]
    worlds.controllers["target"]["position"][0] = held + np.array([0.0, 0.15, 0.1])
    impulse, momenta = np.zeros(6), []
    for _ in range(150):
        truth = worlds.records[0]["truth"]
        p, weight = state_of(truth["q"], truth["qd"])
        momenta.append(p)
        worlds.run(1)
        impulse += 0.001 * (worlds.records[0]["truth"]["base_wrench"] - weight)
    gained = state_of(truth["q"], truth["qd"])[0] - momenta[0]
    assert np.linalg.norm(gained) > 0.1
    assert_allclose(-impulse, gained, atol=0.02 * np.linalg.norm(gained) + 0.02)


@pytest.mark.parametrize("link", [1, 4, 7])
def test_a_push_shows_as_its_force_and_its_moment(link):
    worlds, force = worlds_with(), np.array([6.0, -8.0, 5.0])
    worlds.push(0, f"link{link}", np.array([0.0, 0.0, 0.05]), force, 0.3, 10.0)
    seen = played(worlds, 1500)["wrench_base"]
    body = worlds.datas[0].body(f"link{link}")
    point = body.xpos + body.xmat.reshape(3, 3) @ [0.0, 0.0, 0.05]
    weight = state_of(worlds.records[0]["truth"]["q"], np.zeros(ARM.n))[1]
    assert_allclose(seen[-1] - weight, np.concatenate([force, np.cross(point, force)]), atol=0.3)


def test_an_obstacle_that_presses_on_the_arm_shows_as_its_force():
    at = ARM.tool_pose(ARM.home).position - np.array([0.0, 0.3, 0.0])
    ball = Obstacle(tuple(at), 0.05, stiffness=2000.0, travel=(0.0, 0.25, 0.0), travel_s=(0.1, 0.6))
    worlds = worlds_with(obstacles=(ball,))
    found = played(worlds, 1500)
    change = found["wrench_base"][-1, :3] - found["wrench_base"][50, :3]
    assert found["obstacle_force"][-1] > 2.0
    assert_allclose(np.linalg.norm(change), found["obstacle_force"][-1], rtol=0.05, atol=0.2)


def test_noise_and_bias_are_those_that_are_stated():
    sensors = replace(EXACT, base_force_n=0.5, base_moment_nm=0.05, base_force_bias_n=4.0, base_moment_bias_nm=1.0)
    exact, noisy = (played(worlds_with(one), 1000)["wrench_base"][300:] for one in (EXACT, sensors))
    assert_allclose((noisy - exact).std(axis=0), [0.5] * 3 + [0.05] * 3, rtol=0.1)
    bias = (noisy - exact).mean(axis=0)
    assert 0.5 < np.abs(bias[:3]).max() < 16.0
    assert 0.1 < np.abs(bias[3:]).max() < 4.0


def test_without_it_nothing_is_measured_and_the_other_sensors_say_the_same():
    """Its noise comes last, and that of the others is sampled as it was."""
    blind = worlds_with(SensorConfig())
    seen = played(blind, 20)
    assert blind.controllers[0]["measurement"]["has_base"] == 0
    assert not seen["wrench_base"].any()
    assert not blind.records[0]["truth"]["base_wrench"].any()
    one = worlds_with(replace(NO_NOISE, base=True))
    assert_array_equal(played(one, 20)["q"], played(worlds_with(NO_NOISE), 20)["q"])


def test_no_torque_depends_on_it():
    told, untold = worlds_with(EXACT), worlds_with(NO_NOISE)
    for worlds in (told, untold):
        worlds.use(presets.safe())
        worlds.seed(0)
        worlds.reset(0, ARM.home)
        worlds.push(0, "link4", np.zeros(3), np.array([0.0, 30.0, 0.0]), 0.4, 10.0)
    assert_array_equal(played(told, 900)["torque"], played(untold, 900)["torque"])


def test_an_engine_without_one_says_so():
    pytest.importorskip("pybullet")
    with pytest.raises(InvalidInputError) as raised:
        BulletBackend(ARM, WorldConfig(sensors=SensorConfig(base=True)), 0.001)
    assert str(raised.value) == (
        "a sensor under the base is asked for; the PyBullet engine has none, take the MuJoCo engine"
    )
