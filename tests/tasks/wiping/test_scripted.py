"""Scripted policies: the raster needs no images and is gentle, random actions wipe next to nothing. No torch."""

import gymnasium
import numpy as np
import pytest

import contactsafe  # noqa: F401  (registers the task)
from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks import task_by_name
from contactsafe.tasks.base.evaluation import evaluate_policy
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.scripted import DESCENT_M_S, Raster

CONFIG = WipingConfig()
TASK = task_by_name("wiping")


def results(name, episodes=4):
    env = gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=episodes, config=CONFIG)
    try:
        return evaluate_policy(TASK.scripted_policy(name, CONFIG, env, 0), env, episodes, seed=3)
    finally:
        env.close()


def test_the_raster_clears_every_board_gently():
    found = results("raster")
    assert found["cleared_99"] == 1.0
    assert found["peak_force_max_n"] < 20.0
    assert 2.0 < found["contact_force_median_n"] < 15.0


def test_random_actions_wipe_next_to_nothing():
    assert results("random")["ink_removed_mean"] < 0.2


def test_a_blank_mask_leaves_the_servo_where_it_is():
    env = gymnasium.make_vec("contactsafe/Wiping-v0", num_envs=1, config=CONFIG)
    servo = TASK.scripted_policy("nearest-ink", CONFIG, env, 0)
    seen, _ = env.reset(seed=1)
    seen["mask"][:] = 255
    np.testing.assert_allclose(servo.act(seen)[0, :2], 0.0, atol=1e-6)
    env.close()


def test_lands_slowly_and_each_episode_anew():
    raster = Raster(CONFIG, 1)
    at_corner = {
        "pose": np.array([[*raster._corners[0], 0.05, 0, 0, 0]]),
        "target": np.zeros((1, 18)),
        "force": np.zeros((1, 3)),
    }
    down = -DESCENT_M_S / 60.0 / CONFIG.action.translation[2]
    assert raster.act(at_corner)[0, 2] == pytest.approx(down)
    pressed = {**at_corner, "force": np.array([[0.0, 0.0, 6.0]])}
    assert raster.act(pressed)[0, 2] > 0.0
    raster.begin(0)
    assert raster.act(at_corner)[0, 2] == pytest.approx(down)


def test_unknown_scripted_policy():
    with pytest.raises(InvalidInputError) as error:
        TASK.scripted_policy("oracle", CONFIG, None, 0)
    assert str(error.value) == "scripted policy 'oracle' is unknown; choose one of raster, nearest-ink, random"
