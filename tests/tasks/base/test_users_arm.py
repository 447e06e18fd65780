"""Somebody's robot, an MJCF string that the package has never seen, in its environments; public names alone."""

import copy
import functools
from dataclasses import replace

import gymnasium
import mujoco
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import contactsafe as cs
from contactsafe.robot.panda import PANDA
from contactsafe.robot.robots import Tip
from contactsafe.tasks import make_vec, task_by_name
from contactsafe.tasks.base.pushes import Pushes
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.insertion.tasks import InsertionTasks
from contactsafe.tasks.wiping.config import BoardConfig, WipingConfig
from contactsafe.tasks.wiping.randomisation import Randomisation

ROBOT = """
<mujoco model="palletiser">
  <compiler angle="radian"/>
  <default><joint axis="0 1 0" range="-3 3" armature="0.15"/><geom type="capsule" size="0.05" mass="3"/></default>
  <worldbody>
    <body name="column" pos="-0.1 0 0.05">
      <geom type="cylinder" size="0.09 0.15" pos="0 0 0.15" mass="20"/>
      <body pos="0 0 0.35"><joint name="turn" axis="0 0 1"/><geom type="box" size="0.06 0.06 0.06"/>
        <body><joint name="shoulder"/><geom fromto="0 0 0 0 0 0.4"/>
          <body pos="0 0 0.4"><joint name="elbow"/><geom fromto="0 0 0 0.4 0 0" size="0.04"/>
            <body pos="0.4 0 0"><joint name="pitch"/><geom type="sphere" size="0.05" mass="1"/>
              <body pos="0.05 0 0"><joint name="roll" axis="1 0 0"/>
                <geom fromto="0 0 0 0.04 0 0" size="0.04" mass="1"/>
                <body pos="0.08 0 0"><joint name="yaw" axis="0 0 1" range="-2 2"/>
                  <geom type="cylinder" size="0.04 0.02" mass="0.5"/>
                  <body name="mop" pos="0.05 0 0">
                    <geom type="box" size="0.03 0.02 0.02" mass="0.3"/>
                    <site name="mop" pos="0.05 0 0" xyaxes="0 0 1 0 -1 0"/>
                  </body>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="turn" ctrlrange="-150 150"/><motor joint="shoulder" ctrlrange="-150 150"/>
    <motor joint="elbow" ctrlrange="-150 150"/><motor joint="pitch" ctrlrange="-40 40"/>
    <motor joint="roll" ctrlrange="-40 40"/><motor joint="yaw" ctrlrange="-40 40"/>
  </actuator>
  <keyframe><key name="home" qpos="0 0.3 0.2 1.07 0 0"/></keyframe>
</mujoco>
"""
PAD = Tip((0.04, 0.035, 0.02))


@functools.cache
def robot(tip=PAD):
    return cs.robots.from_mjcf(mujoco.MjModel.from_xml_string(ROBOT), site="mop", tip=tip)


def test_one_line_makes_an_environment_of_a_robot_of_ones_own():
    env = gymnasium.make("contactsafe/Wiping-v0", arm=robot())
    seen, _ = env.reset(seed=0)
    assert env.observation_space.contains(seen)
    for _ in range(30):
        seen, reward, terminated, _, info = env.step(env.action_space.sample() * 0.0)
        assert np.isfinite(reward)
        assert not terminated
    assert env.observation_space.contains(seen)
    assert not info["arm_touched"]
    env.close()


def test_it_wipes_a_raster_for_eight_seconds_without_fault():
    config = WipingConfig(episode_s=8.0)
    envs = make_vec("wiping", 2, config, arm=robot())
    seen, _ = envs.reset(seed=1)
    raster = task_by_name("wiping").scripted_policy("raster", config, envs, 0)
    for i in range(2):
        raster.begin(i)
    for _ in range(479):
        seen, _, terminated, _, info = envs.step(raster.act(seen))
        assert not terminated.any()
        assert not envs.unwrapped.tasks.worlds.controllers["output"]["fault"].any()
    assert (info["ink_left"] < 0.9).all()
    assert (info["tool_force_n"] > 1.0).any()
    envs.close()


def test_episodes_of_its_worlds_do_not_depend_on_how_many_are_stepped_beside_them():
    one, three = (make_vec("wiping", n, WipingConfig(episode_s=0.5), arm=robot()) for n in (1, 3))
    one.reset(seed=4), three.reset(seed=4)
    action = np.zeros((3, 18), np.float32)
    action[:, 2] = -1.0
    for _ in range(20):
        alone, beside = one.step(action[:1])[0], three.step(action)[0]
    assert_array_equal(alone["pose"][0], beside["pose"][0])
    one.close(), three.close()


def test_a_copy_goes_on_to_the_bit():
    env = gymnasium.make("contactsafe/Wiping-v0", arm=robot(), disable_env_checker=True).unwrapped
    env.reset(seed=2)
    other = copy.deepcopy(env)
    for _ in range(5):
        ours, theirs = env.step(np.zeros(18))[0], other.step(np.zeros(18))[0]
    for name in ours:
        assert_array_equal(ours[name], theirs[name])
    env.close(), other.close()


def test_pushes_and_randomisation_are_those_of_any_arm():
    config = WipingConfig(episode_s=0.5, pushes=Pushes(), randomisation=Randomisation.broad())
    envs = make_vec("wiping", 2, config, arm=robot())
    envs.reset(seed=0)
    for _ in range(10):
        seen, *_ = envs.step(np.zeros((2, 18)))
    assert np.isfinite(seen["pose"]).all()
    envs.close()


def test_the_second_engine_takes_it():
    pytest.importorskip("pybullet")
    ends = []
    for engine in ("mujoco", "pybullet"):
        envs = make_vec("wiping", 1, WipingConfig(episode_s=1.0), engine, arm=robot())
        envs.reset(seed=3)
        for _ in range(40):
            seen, *_ = envs.step(np.zeros((1, 18)))
        ends.append(seen["pose"][0])
        envs.close()
    np.testing.assert_allclose(*ends, rtol=0, atol=2e-3)


FAR = WipingConfig(board=BoardConfig(centre=(1.5, 0.0, 0.01)))
LIGHTER = WipingConfig(randomisation=Randomisation(payload_kg=(-0.3, 0.2)))
REFUSED = {
    "no tip": (
        None, WipingConfig(),
        "arm 'palletiser' has no tip, and task 'wiping' needs a box; give it the tool robots.WIPER, or "
        "robots.from_mjcf(..., tip=robots.Tip((0.02, 0.02, 0.01)))",
    ),
    "round tip": (
        Tip((0.02, 0.02, 0.02), "cylinder"), WipingConfig(),
        "arm 'palletiser' has a cylinder for a tip, and task 'wiping' needs a box; give it the tool robots.WIPER, or "
        "robots.from_mjcf(..., tip=robots.Tip((0.02, 0.02, 0.01)))",
    ),
    "out of reach": (
        PAD, FAR,
        "task 'wiping' needs the tool at [1.400, -0.100, 0.040] m, pointing down, where arm 'palletiser' does not "
        "reach; change board.centre of WipingConfig, or give the arm another base",
    ),
    "lighter than nothing": (
        PAD, LIGHTER,
        "randomisation payload_kg = (-0.3, 0.2) takes more than the 0.3 kg of tool 'mop'; give (0.0, 0.2)",
    ),
    "pushed on a link it has not": (
        PAD, WipingConfig(pushes=Pushes(links=(5, 7))),
        "pushes links = (5, 7); arm 'palletiser' has 6, give some of those",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_task_cannot_do_with_an_arm_is_said_in_one_line(name):
    tip, config, text = REFUSED[name]
    with pytest.raises(cs.ContactSafeError) as caught:
        make_vec("wiping", 1, config, arm=robot(tip))
    assert str(caught.value) == text


NEEDS_PEG = (
    "task 'insertion' needs a cylinder; give it the tool contactsafe.tasks.insertion.scene.PEG, or "
    'robots.from_mjcf(..., tip=robots.Tip((0.01, 0.01, 0.03), "cylinder"))'
)
NO_PEG = {
    "no tip": (None, f"arm 'palletiser' has no tip, and {NEEDS_PEG}"),
    "a box": (PAD, f"arm 'palletiser' has a box for a tip, and {NEEDS_PEG}"),
    "thick": (
        Tip((0.05, 0.05, 0.03), "cylinder"),
        "arm 'palletiser' has a peg of radius 0.05 m, 0.06 m long; give it a radius of 0.002 to 0.03 m, and a length "
        "of depth_m = 0.025 m or more",
    ),
    "short": (
        Tip((0.01, 0.01, 0.01), "cylinder"),
        "arm 'palletiser' has a peg of radius 0.01 m, 0.02 m long; give it a radius of 0.002 to 0.03 m, and a length "
        "of depth_m = 0.025 m or more",
    ),
}


@pytest.mark.parametrize("name", NO_PEG)
def test_an_arm_without_a_peg_was_taken_for_one_of_20_mm(name):
    tip, text = NO_PEG[name]
    with pytest.raises(cs.ContactSafeError) as caught:
        make_vec("insertion", 1, arm=robot(tip))
    assert str(caught.value) == text


@pytest.mark.parametrize("radius", [0.006, 0.015])
def test_the_hole_is_as_wide_as_the_arms_own_peg(radius):
    config = InsertionConfig(error_m=0.0, tilt_rad=0.0)
    tasks = InsertionTasks(config, 1, seed=0, arm=robot(Tip((radius, radius, 0.03), "cylinder")))
    tasks.reset(0, np.random.default_rng(0))
    model = tasks.worlds.models[0]
    wall, mouth = model.geom("wall0"), np.array(config.mouth)
    np.testing.assert_allclose(wall.pos[0] - wall.size[0], radius + config.clearance_m)
    assert tasks.hole_radius == radius + config.clearance_m
    down = np.zeros((1, 18))
    down[:, 2] = -0.4
    for _ in range(300):
        tasks.step(down)
    assert np.linalg.norm(tasks.tasks["pose"][0, :2] - mouth[:2]) < 0.003
    assert tasks.tasks["depth"][0] > 0.01
    tasks.worlds.close()


BASE = 'name="column" pos="-0.1 0 0.05">'
FAR_FROM = "task '{}' needs the tool at {} m, pointing down, where arm 'palletiser' does not reach; change {}"
FAR_FROM_BOARD = FAR_FROM.format("wiping", "[0.400, -0.100, 0.040]", "board.centre of WipingConfig")
FAR_FROM_MOUTH = FAR_FROM.format("insertion", "[0.495, -0.005, 0.065]", "mouth of InsertionConfig")
HINGES = (
    "the arm's are hinges: give joints=[...] without it, to lock it; those that fit are "
    "joints=['turn', 'shoulder', 'elbow', 'pitch', 'roll', 'yaw']"
)
NO_ARM = {
    "a description": ("wiping", lambda: PANDA, "arm is ArmDescription; give an Arm such as contactsafe.robots.panda()"),
    "a name": ("wiping", lambda: "panda", "arm is str; give an Arm such as contactsafe.robots.panda()"),
    "a mobile base": (
        "wiping", lambda: scene_of(ROBOT.replace(BASE, BASE + "<freejoint name='float'/>")),
        "joint 'float' is of type free; " + HINGES,
    ),
    "a base on a rail": (
        "wiping", lambda: scene_of(ROBOT.replace(BASE, BASE + "<joint name='rail' type='slide'/>")),
        "joint 'rail' is of type slide; " + HINGES,
    ),
    "three joints": (
        "wiping", lambda: scene_of(ROBOT, joints=["turn", "shoulder", "elbow"]),
        f"{FAR_FROM_BOARD}, or give the arm another base",
    ),
    "a board out of reach": (
        "wiping", lambda: scene_of(ROBOT.replace("-0.1 0 0.05", "-2 0 0.05")),
        f"{FAR_FROM_BOARD}, or give the arm another base",
    ),
    "a hole out of reach": (
        "insertion", lambda: scene_of(ROBOT.replace("-0.1 0 0.05", "-2 0 0.05")),
        f"{FAR_FROM_MOUTH}, or give the arm another base",
    ),
    "no description": (
        "wiping", lambda: replace(robot(), description=None),
        "arm 'palletiser' has no description of its links and tool; give contactsafe.robots.panda(), or one of "
        "robots.from_mjcf",
    ),
}  # fmt: skip


def scene_of(text, joints=None):
    return cs.robots.from_mjcf(mujoco.MjModel.from_xml_string(text), site="mop", joints=joints, tip=PAD)


@pytest.mark.parametrize("name", NO_ARM)
def test_an_arm_that_a_task_cannot_work_with_is_refused_in_one_line(name):
    task, make, text = NO_ARM[name]
    with pytest.raises(cs.ContactSafeError) as caught:
        make_vec(task, 1, arm=make())
    assert str(caught.value) == text
