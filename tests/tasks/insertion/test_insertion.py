"""Insertion: what is drawn and observed, what pays, how it ends."""

import copy
import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose

from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks import make_vec, task_by_name
from contactsafe.tasks.base.evaluation import HELD_OUT_SEED, evaluate_policy
from contactsafe.tasks.base.task_env import TaskEnv
from contactsafe.tasks.insertion import picture
from contactsafe.tasks.insertion.config import InsertionConfig
from contactsafe.tasks.insertion.scripted import SCRIPTED
from contactsafe.tasks.insertion.tasks import InsertionTasks

STILL = np.zeros((1, 18))


def begun(config=None, seed=0, n=1, **options):
    tasks = InsertionTasks(config or InsertionConfig(), n, seed=0)
    for i in range(n):
        tasks.reset(i, np.random.default_rng(seed + i), **options)
    return tasks


def down(speed=1.0):
    action = STILL.copy()
    action[:, 2] = -speed
    return action


def test_holes_are_drawn_within_what_is_stated_and_nothing_tells_the_policy_where():
    config = InsertionConfig()
    tasks = begun(config, n=16)
    away = tasks.tasks["mouth"] - tasks.tasks["believed"]
    assert np.abs(away[:, :2]).max() <= config.error_m
    assert np.ptp(away[:, :2]) > config.error_m
    tilt = np.arccos(-tasks.tasks["axis"][:, 2])
    assert 0.0 < tilt.max() <= np.hypot(config.tilt_rad, config.tilt_rad)
    observation = tasks.observation()
    starts = observation["offset"][:, 2]
    assert ((starts >= config.start_m[0] - 1e-6) & (starts <= config.start_m[1] + 1e-6)).all()
    assert_allclose(observation["offset"][:, :2], 0.0, atol=1e-4)  # above where it is believed to be


def test_the_wrench_is_zero_in_the_air_whatever_the_bias_of_the_sensor():
    tasks = begun()
    for _ in range(30):
        tasks.step(STILL)
    assert np.abs(tasks.worlds.controllers["measurement"]["wrench_ee"][0, :3]).max() > 0.05
    wrench = tasks.observation(0)["wrench"]
    assert np.abs(wrench[:3]).max() < 0.4
    assert np.abs(wrench[3:]).max() < 0.02


def test_a_press_beside_the_hole_is_bounded_and_felt_on_the_side_that_rests():
    tasks = begun(InsertionConfig(error_m=0.006, tilt_rad=0.0), n=12)
    away = (tasks.tasks["mouth"] - tasks.tasks["believed"])[:, :2]
    for _ in range(90):
        tasks.step(np.repeat(down(), 12, axis=0))
    wrench = tasks.observation()["wrench"]
    rests = np.linalg.norm(away, axis=1) > 0.003  # nearer the peg drops in
    assert rests.sum() >= 6
    assert ((wrench[rests, 2] > 5.0) & (wrench[rests, 2] < 40.0)).all()
    place = np.stack([-wrench[:, 4], wrench[:, 3]], axis=1) / wrench[:, 2:3]
    # Where it rests is a sickle, whose ends reach a little to the hole's side.
    assert (np.sum(place * away, axis=1)[rests] < 0.0).mean() > 0.7


def test_a_hole_straight_below_is_entered_to_full_depth():
    tasks = begun(InsertionConfig(error_m=0.0, tilt_rad=0.0))
    for _ in range(600):
        tasks.step(down(0.4))
        if tasks.terminated[0]:
            break
    assert tasks.info()["is_success"][0]
    assert tasks.tasks["depth"][0] >= tasks.config.depth_m
    assert tasks.tasks["reward"][0, 2] == tasks.config.reward.done


def test_the_rewards_for_approach_and_depth_sum_to_what_was_gained():
    tasks = begun(InsertionConfig(error_m=0.0, tilt_rad=0.0))
    away, total = tasks.tasks["away"][0], np.zeros(2)
    rng = np.random.default_rng(0)
    for _ in range(200):
        tasks.step(down(0.4) + 0.2 * rng.normal(size=(1, 18)))
        total += tasks.tasks["reward"][0, :2]
    reward = tasks.config.reward
    assert total[0] == pytest.approx(reward.approach * (away - tasks.tasks["away"][0]), abs=1e-6)
    assert total[1] == pytest.approx(reward.depth * tasks.tasks["depth"][0], abs=1e-6)


def test_time_is_up_after_ten_seconds():
    tasks = begun()
    assert tasks.step_limit == 600
    for _ in range(600):
        assert not tasks.truncated[0]
        tasks.step(STILL)
    assert tasks.truncated[0]
    assert tasks.observation(0)["elapsed"][0] == pytest.approx(10.0)


def test_scripts_are_gentle_and_a_search_finds_more_than_going_straight_down():
    found = {}
    for name in ("spiral", "straight-down", "random"):
        env = make_vec("insertion", 8)
        policy = SCRIPTED[name](InsertionConfig(), env, 0)
        found[name] = evaluate_policy(policy, env, 32, HELD_OUT_SEED)
        env.close()
        assert found[name]["peak_force_max_n"] < 60.0
    assert found["spiral"]["success"] > found["straight-down"]["success"] > found["random"]["success"] - 1e-9
    assert found["random"]["success"] < 0.2


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"clearance_m": 0.0}, "clearance_m = 0.0; give 0.00001 to 0.005 m, between the radii"),
        ({"depth_m": 0.04}, "depth_m = 0.04; give more than 0 and at most 0.03 m"),
        ({"error_m": -1.0}, "error_m = -1.0, tilt_rad = 0.035; give at most 0.02 m and 0.2 rad, none negative"),
        ({"start_m": (0.02, 0.01)}, "start_m = (0.02, 0.01); give (low, high) with 0 ≤ low ≤ high ≤ 0.2 m"),
        ({"friction": (0.5, 0.1)}, "friction = (0.5, 0.1); give (low, high) with 0 ≤ low ≤ high ≤ 2"),
        ({"mouth": (0.5, float("nan"), 0.05)}, "mouth = (0.5, nan, 0.05); give three finite numbers x, y, z, m"),
        ({"episode_s": 0}, "episode_s = 0; give seconds, from 1/60 to 86400, a day"),
    ],
)
def test_holes_that_cannot_be_are_refused(fields, told):
    with pytest.raises(InvalidInputError) as error:
        InsertionConfig(**fields)
    assert str(error.value) == told


@pytest.mark.parametrize(
    ("height", "told"),
    [
        ("high", "height is str, not numbers; give one finite number"),
        (float("nan"), "height = nan; every number must be finite"),
        (-0.02, "height = -0.02; give 0 to 0.2 m above the believed mouth"),
        (10.0, "height = 10.0; give 0 to 0.2 m above the believed mouth"),
    ],
)
def test_a_height_that_cannot_be_is_refused_before_the_block_moves(height, told):
    tasks = begun()
    before = tasks.state_dict()
    with pytest.raises(InvalidInputError) as error:
        tasks.reset(0, np.random.default_rng(1), height=height)
    assert str(error.value) == told
    np.testing.assert_equal(tasks.state_dict(), before)


def test_an_insertion_in_contact_was_resumed_with_the_block_as_built():
    tasks = begun(InsertionConfig(error_m=0.02, tilt_rad=0.1), n=3)
    for _ in range(60):
        tasks.step(np.repeat(down(), 3, axis=0))
    assert (tasks.tasks["force_peak"] > 3.0).sum() >= 2
    state = tasks.state_dict()
    others = begun(InsertionConfig(error_m=0.02, tilt_rad=0.1), n=3, seed=7)
    others.load_state_dict(state)
    copies = others, copy.deepcopy(tasks), pickle.loads(pickle.dumps(tasks))
    rng = np.random.default_rng(0)
    for _ in range(60):
        actions = rng.uniform(-1.0, 1.0, (3, 18))
        for each in (tasks, *copies):
            each.step(actions)
        for each in copies:
            np.testing.assert_equal(each.observation(), tasks.observation())
            np.testing.assert_equal(each.info(), tasks.info())
    for field in ("body_pos", "body_quat", "geom_friction"):
        for model, other in zip(tasks.worlds.models, others.worlds.models, strict=True):
            np.testing.assert_array_equal(getattr(other, field), getattr(model, field))


def test_the_picture_shows_hole_peg_and_believed_mouth_where_they_are():
    env = TaskEnv("insertion", render_mode="rgb_array")
    assert env.metadata["render_modes"] == ["rgb_array"]
    env.reset(seed=0)
    seen, task = env.render(), env.tasks.tasks[0]
    assert seen.shape == (picture.SIZE, picture.SIZE, 3)
    pixel = 2.0 * picture.HALF_M / picture.SIZE
    peg = middle(seen, picture.PEG, pixel)
    assert_allclose(peg, env.tasks.worlds.records[0]["truth"]["position"][:2] - task["believed"][:2], atol=2 * pixel)
    assert_allclose(middle(seen, picture.BELIEVED, pixel), 0.0, atol=2 * pixel)
    alone = picture.paint(picture.TopView(np.zeros(2), np.array([0.004, -0.01]), np.ones(2), 0.0105, 0.01, 0.5))
    hole = (alone == picture.HOLE).all(axis=-1)
    assert hole.sum() * pixel**2 == pytest.approx(np.pi * 0.0105**2, rel=0.06)  # the cross covers some
    assert_allclose(middle(alone, picture.HOLE, pixel), (0.004, -0.01), atol=4 * pixel)
    assert (alone[picture.SIZE // 2 :, -1] == picture.PEG).all()
    assert (alone[: picture.SIZE // 2, -1] == picture.FACE).all()
    env.close()


def middle(seen, colour, pixel):
    """The middle of what has a colour, x and y from the picture's, m."""
    return (picture.SIZE / 2 - np.argwhere((seen == colour).all(axis=-1)).mean(axis=0) - 0.5) * pixel


def test_options_become_the_configuration():
    task = task_by_name("insertion")
    config = task.config(task.options(controller="vices", clearance_mm=0.2, error_mm=3.0))
    assert (config.controller, config.clearance_m, config.error_m) == (
        "vices",
        pytest.approx(2e-4),
        pytest.approx(3e-3),
    )
