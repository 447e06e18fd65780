"""An action moves the target by what the configuration says, and never out of bounds; 17, 17, 16 ticks at a time."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.rotation import quat_multiply, rotvec_to_quat
from contactsafe.policy.action import DOWN, rotation_from_down
from contactsafe.policy.action_config import ACTION_SIZE, ACTIONS, GAINS, ActionConfig, action_limits, learned_actions
from contactsafe.robot.arm import Pose
from contactsafe.robot.ik import InverseKinematics
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.tasks import WipingTasks

CONFIG = ActionConfig()
STEP = np.array([*CONFIG.translation, *CONFIG.rotation, *CONFIG.stiffness, *CONFIG.damping])


@pytest.fixture
def tasks():
    made = WipingTasks(WipingConfig(controller="vices"), seed=0)
    made.reset(0, np.random.default_rng(0), start=(0.5, 0.0, 0.06))
    return made


def target_of(tasks):
    """x_d, its rotation from straight down, K1 and D1, (18,)."""
    target = tasks.worlds.controllers[0]["target"]
    return np.concatenate(
        [target["position"], rotation_from_down(target["quat"].copy()), target["K_task"], target["D_task"]]
    )


def act(tasks, index, value, steps=1):
    action = np.zeros((1, 18))
    action[0, index] = value
    for _ in range(steps):
        tasks.step(action)


def test_steps_last_17_17_16_ticks(tasks):
    ticks = []
    for _ in range(9):
        tasks.step(np.zeros((1, 18)))
        ticks.append(int(tasks.worlds.metrics["ticks"][0]))
    assert ticks == [17, 17, 16] * 3
    assert tasks.worlds.records[0]["tick"] == 150  # 9 steps of 1/60 s


@pytest.mark.parametrize("index", range(18), ids=ACTIONS)
@pytest.mark.parametrize("value", [0.5, -1.0])
def test_each_number_moves_its_own_part_of_the_target(tasks, index, value):
    before = target_of(tasks)
    act(tasks, index, value)
    moved = np.zeros(ACTION_SIZE)
    moved[index] = value * STEP[index]
    assert_allclose(target_of(tasks) - before, moved, rtol=0, atol=1e-8)


def test_actions_beyond_one_count_as_one(tasks):
    before = target_of(tasks)
    act(tasks, slice(None), 50.0)
    assert_allclose(target_of(tasks) - before, STEP, rtol=0, atol=1e-5)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_stiffness_and_damping_keep_to_their_range(tasks, sign):
    act(tasks, slice(6, 18), sign, steps=60)
    target = tasks.worlds.controllers[0]["target"]
    which = "high" if sign > 0 else "low"
    assert_array_equal(target["K_task"], getattr(CONFIG, f"stiffness_{which}"))
    assert_array_equal(target["D_task"], getattr(CONFIG, f"damping_{which}"))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_x_d_keeps_within_a_hand_of_the_tool(tasks, sign):
    for _ in range(25):
        before = tasks.worlds.controllers[0]["output"]["position"].copy()
        act(tasks, slice(0, 2), sign)
        offset = target_of(tasks)[:2] - before[:2]
        assert np.abs(offset).max() <= CONFIG.offset_max + 1e-12
    assert_allclose(np.abs(offset).max(), CONFIG.offset_max, atol=0.02)


def test_x_d_keeps_to_its_box(tasks):
    board = np.array(tasks.config.board.centre)
    act(tasks, 2, 1.0, steps=60)
    assert_allclose(target_of(tasks)[2], board[2] + CONFIG.height)
    act(tasks, 1, 1.0, steps=100)
    assert target_of(tasks)[1] <= board[1] + CONFIG.reach + 1e-12
    act(tasks, 2, -1.0, steps=80)
    assert_allclose(target_of(tasks)[2], board[2] - CONFIG.press)


def test_tilt_keeps_to_its_range(tasks):
    act(tasks, slice(3, 6), 1.0, steps=20)
    assert_allclose(target_of(tasks)[3:6], CONFIG.tilt, atol=1e-9)


def test_the_posture_follows_x_d(tasks):
    act(tasks, 1, 1.0, steps=6)
    target = tasks.worlds.controllers[0]["target"]
    pose = tasks.arm.tool_pose(target["q_posture"])
    assert_allclose(pose.position, target["position"], atol=1e-3)
    assert abs(pose.quat @ target["quat"]) > 1 - 1e-4


def test_the_posture_does_not_depend_on_the_way_of_x_d(tasks):
    """Round the board and back: warm-started inverse kinematics came back with the elbow elsewhere."""
    for _ in range(3):
        for index, value in ((0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0)):
            act(tasks, index, value, steps=8)
        target = tasks.worlds.controllers[0]["target"]
        pose = Pose(target["position"].copy(), target["quat"].copy())
        assert_allclose(target["q_posture"], InverseKinematics(tasks.arm).posture(pose), rtol=0, atol=1e-9)


@pytest.mark.parametrize("rotvec", [(0.0, 0.0, 0.0), (0.1, -0.05, 0.02), (0.0, 0.0, 0.8)])
def test_rotation_from_down_undoes_what_turned_it(rotvec):
    quat = quat_multiply(rotvec_to_quat(np.array(rotvec)), DOWN)
    assert_allclose(rotation_from_down(quat), rotvec, atol=1e-12)
    assert_allclose(rotation_from_down(-quat), rotvec, atol=1e-12)


def test_the_tool_goes_where_x_d_goes(tasks):
    act(tasks, 1, 1.0, steps=12)
    act(tasks, 1, 0.0, steps=80)
    assert_allclose(tasks.tasks["pose"][0, :3], target_of(tasks)[:3], atol=0.01)
    assert tasks.tasks["pose"][0, 1] > 0.03


CONSTANT = {"low": CONFIG.stiffness_low, "middle": (155.0,) * 3 + (475.0,) * 3, "high": CONFIG.stiffness_high}


@pytest.mark.parametrize("gains", CONSTANT)
def test_constant_gains_stay_whatever_is_asked_and_are_critical(gains):
    made = WipingTasks(WipingConfig(controller="vices", action=ActionConfig(gains=gains)), seed=0)
    made.reset(0, np.random.default_rng(0), start=(0.5, 0.0, 0.06))
    for value in (1.0, -1.0, 0.3):
        target = made.worlds.controllers[0]["target"]
        assert_allclose(target["K_task"], CONSTANT[gains], rtol=1e-15)
        assert_allclose(target["D_task"], 2.0 * np.sqrt(CONSTANT[gains]), rtol=1e-15)
        act(made, slice(6, 18), value, steps=3)


@pytest.mark.parametrize("gains", ["low", "middle", "high"])
def test_constant_damping_is_none_that_a_policy_could_not_choose(gains):
    config = replace(InsertionConfig.action, gains=gains)
    limits = action_limits(config, (0.0, 0.0, 0.0))
    assert_array_equal(limits.D_low, limits.D_high)
    assert_array_equal(limits.D_low, np.clip(2.0 * np.sqrt(limits.K_low), config.damping_low, config.damping_high))


def test_learned_gains_have_the_range_and_the_start_that_are_configured():
    limits = action_limits(CONFIG, (0.0, 0.0, 0.0))
    assert_array_equal(limits.K_low, CONFIG.stiffness_low)
    assert_array_equal(limits.D_high, CONFIG.damping_high)
    assert_array_equal(CONFIG.stiffness_first, CONFIG.stiffness_start)


def test_what_gains_leave_to_learn():
    assert [learned_actions(gains) for gains in GAINS] == [18, 6, 6, 6]
    with pytest.raises(InvalidInputError) as error:
        ActionConfig(gains="soft")
    assert str(error.value) == "gains = 'soft'; choose from learned, low, middle, high"


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"translation": (0.0, 0.001, 0.001)}, "translation = (0.0, 0.001, 0.001); give three steps greater than 0 m"),
        ({"rotation": (-0.1, 0.0, 0.0)}, "rotation = (-0.1, 0.0, 0.0); give 3 steps of 0 or more"),
        ({"damping": (1.0,)}, "damping = (1.0,); give 6 steps of 0 or more"),
        ({"stiffness_low": (300.0,) * 6}, "give six each, with 0 < low ≤ high"),
        ({"damping_high": (float("nan"),) * 6}, "give six each, with 0 < low ≤ high"),
        ({"stiffness_start": (0.0,) * 6}, "give six greater than 0 1/s²"),
        ({"offset_max": -0.01}, "offset_max = -0.01, offset_max_z = inf; give more than 0 m, or inf for no bound"),
        ({"reach": -0.1}, "give a reach, a tilt and a press + height of 0 or more"),
        ({"press": -0.2, "height": 0.1}, "give a reach, a tilt and a press + height of 0 or more"),
    ],
)
def test_steps_and_bounds_that_cannot_be_are_refused(fields, told):
    with pytest.raises(InvalidInputError) as error:
        ActionConfig(**fields)
    assert str(error.value).startswith("action ")
    assert told in str(error.value)
