"""Episodes that differ: what is drawn is in force, is forgotten by the next, and never leaves its range."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import contactsafe  # noqa: F401  (registers the task)
from contactsafe import robots
from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.randomisation import Randomisation, sample
from contactsafe.tasks.wiping.tasks import WipingTasks

BROAD = WipingConfig(randomisation=Randomisation.broad(), episode_s=0.5)


def varied(n=1, **ranges):
    tasks = WipingTasks(WipingConfig(randomisation=Randomisation(**ranges)), n, seed=0)
    for i in range(n):
        tasks.reset(i, np.random.default_rng(i))
    return tasks


def pressed(tasks, steps=60):
    """Lower the pad for a second and return where it came to rest, m, and the force, N."""
    down = np.zeros((tasks.worlds.n, 18))
    down[:, 2] = -1.0
    for _ in range(steps):
        tasks.step(down)
    return tasks.worlds.controllers["output"]["position"][:, 2], tasks.tasks["force_mean"]


def test_draws_stay_in_their_ranges():
    ranges, rng = Randomisation.broad(), np.random.default_rng(0)
    drawn = [sample(ranges, 16, rng) for _ in range(200)]
    for name in ("board_height_m", "friction", "pad_size", "payload_kg", "delay_steps", "ink_missed"):
        low, high = getattr(ranges, name)
        values = np.array([one[name] for one in drawn])
        assert low <= values.min() < low + 0.1 * (high - low) + 1e-9
        assert high - 0.1 * (high - low) - 1e-9 < values.max() <= high


def test_ranges_that_change_nothing_change_nothing():
    plain, still = WipingTasks(WipingConfig(), 1, seed=0), varied()
    for tasks in (plain, still):
        tasks.worlds.seed(1)
        tasks.reset(0, np.random.default_rng(5), start=(0.5, 0.0, 0.05), drawing=np.eye(9))
    actions = np.random.default_rng(2).uniform(-1, 1, (60, 1, 18))
    for action in actions:
        plain.step(action), still.step(action)
    for name, value in plain.observation().items():
        assert_array_equal(still.observation()[name], value, err_msg=name)


def test_the_pad_meets_the_board_where_it_was_drawn():
    low, high = (pressed(varied(board_height_m=(h, h)))[0][0] for h in (-0.003, 0.02))
    assert_allclose(high - low, 0.023, atol=0.002)


def test_friction_pad_and_payload_are_the_plants_and_gone_with_the_episode():
    tasks = varied(friction=(2.0, 2.0), pad_size=(0.5, 0.5), payload_kg=(0.3, 0.3), joint_friction=(0.0, 0.0))
    model, nominal = tasks.worlds.models[0], WipingTasks(WipingConfig(), 1, seed=0).worlds.models[0]
    for _ in range(2):
        tasks.reset(0, np.random.default_rng(0))
        assert model.geom("tip").friction[0] == pytest.approx(2.0 * nominal.geom("tip").friction[0])
        assert_allclose(model.geom("tip").size[:2], 0.5 * nominal.geom("tip").size[:2])
        assert_allclose(tasks.boards.records[0]["pad_half"], 0.5 * nominal.geom("tip").size[:2])
        assert model.body("tool").mass[0] == pytest.approx(nominal.body("tool").mass[0] + 0.3)
        assert not tasks.worlds.records[0]["errors"]["friction"][:, 0].any()


def test_viscous_and_dry_friction_of_a_calibrated_arm_are_scaled_too():
    arm = replace(robots.panda(), drag=np.tile((0.5, 0.3, 0.2), (7, 1)))
    config = WipingConfig(randomisation=Randomisation(joint_friction=(2.0, 2.0)))
    tasks = WipingTasks(config, 1, seed=0, arm=arm)
    for _ in range(2):
        tasks.reset(0, np.random.default_rng(0))
        errors = tasks.worlds.records[0]["errors"]
        assert_allclose(errors["friction"][:, 0], 2.0 * arm.friction[:, 0])
        assert_allclose(errors["drag"], np.tile((1.0, 0.3, 0.4), (7, 1)))


def test_a_late_picture_is_the_one_of_so_many_steps_ago():
    tasks = varied(delay_steps=(2, 2))
    board, shown = tasks.boards.boards[0], []
    board.clear()
    tasks.observe(0)
    board.paint(np.ones((3, 3)))
    for _ in range(4):
        tasks.step(np.zeros((1, 18)))
        shown.append(bool((tasks.boards.masks[0] == 0).any()))
    assert shown == [False, False, True, True]


def test_ink_is_missed_and_invented_as_often_as_was_drawn():
    tasks, clean = varied(ink_missed=(0.3, 0.3)), varied()
    for one in (tasks, clean):
        one.reset(0, np.random.default_rng(0), drawing=np.ones((3, 3)), start=(0.5, 0.0, 0.1))
    seen, there = [], (clean.boards.masks[0] == 0).sum()
    for _ in range(30):
        tasks.step(np.zeros((1, 18)))
        seen.append((tasks.boards.masks[0] == 0).sum() / there)
    assert np.mean(seen) == pytest.approx(0.7, abs=0.03)
    tasks = varied(ink_invented=(2.5, 2.5))
    tasks.boards.boards[0].clear()
    counts = []
    for _ in range(200):
        tasks.step(np.zeros((1, 18)))
        counts.append((tasks.boards.masks[0] == 0).sum())
    assert np.mean(counts) == pytest.approx(2.5, abs=0.2)


def test_a_perturbed_camera_shifts_the_ink():
    tasks, clean = varied(camera_m=(0.01, 0.01)), varied()
    centres = []
    for one in (tasks, clean):
        one.reset(0, np.random.default_rng(0), drawing=np.ones((3, 3)), start=(0.4, 0.2, 0.1))
        centres.append(np.argwhere(one.boards.masks[0] == 0).mean(0))
    assert 1.0 < np.linalg.norm(centres[0] - centres[1]) < 6.0


def test_a_state_knows_what_was_drawn():
    """Gone on with in another environment, whose episodes had drawn otherwise."""
    first, second = (gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=3, config=BROAD) for _ in range(2))
    first.reset(seed=1), second.reset(seed=2)
    actions = np.random.default_rng(0).uniform(-1, 1, (70, 3, 18))
    for action in actions[:20]:
        first.step(action)
    second.unwrapped.load_state_dict(first.unwrapped.state_dict())
    for action in actions[20:]:
        (one, *rest), (other, *others) = first.step(action), second.step(action)
        for name, value in one.items():
            assert_array_equal(other[name], value, err_msg=name)
        assert_array_equal(rest[0], others[0])
    first.close(), second.close()


def test_ranges_that_no_world_has_are_refused():
    with pytest.raises(InvalidInputError) as error:
        Randomisation(friction=(1.0, 0.5))
    assert str(error.value) == "randomisation friction = (1.0, 0.5); give (low, high) with 0 ≤ low ≤ high ≤ 10"
