"""What the wiping task adds to Gymnasium's interface: masks, drawings of one's own, pictures."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.testing import assert_array_equal

import contactsafe  # noqa: F401 -- registers the task
from contactsafe.core.errors import ContactSafeError, InvalidInputError
from contactsafe.tasks.base.task_env import TaskEnv
from contactsafe.tasks.base.task_vector_env import TaskVectorEnv
from contactsafe.tasks.wiping.config import WipingConfig

NAME = "contactsafe/Wiping-v0"
SHORT = WipingConfig(episode_s=0.1)
"""Six policy steps."""


@pytest.fixture(scope="module")
def env():
    return gymnasium.make(NAME, config=SHORT)


@pytest.fixture
def envs():
    made = gymnasium.make_vec(NAME, num_envs=3, config=SHORT)
    yield made
    made.close()


def test_spaces(env):
    assert env.observation_space["pose"].shape == (6,)
    assert env.observation_space["mask"].shape == (128, 128, 1)


def test_all_ink_is_left_when_an_episode_begins(envs):
    assert_array_equal(envs.reset(seed=0)[1]["ink_left"], 1.0)
    info = envs.step(np.ones((3, 18), np.float32))[-1]
    assert info["ink_left"].shape == (3,)
    mask = np.array([False, True, False])
    assert_array_equal(envs.reset(options={"reset_mask": mask})[1]["_ink_left"], mask)


def test_the_last_mask_is_of_the_board_that_was_wiped_and_the_first_of_another(envs):
    envs.reset(seed=0)
    idle = np.zeros((3, 18), np.float32)
    for _ in range(5):
        before = envs.step(idle)[0]
    observation, *_, info = envs.step(idle)
    assert_array_equal(info["final_info"]["_ink_left"], True)
    for i in range(3):
        assert_array_equal(info["final_obs"][i]["mask"], before["mask"][i])
        assert not np.array_equal(info["final_obs"][i]["mask"], observation["mask"][i])


def test_a_drawing_of_ones_own(env):
    drawing = np.zeros((10, 10))
    drawing[2:4, 5] = 1
    _, info = env.reset(seed=0, options={"drawing": drawing})
    assert info["ink_left"] == 1.0
    assert env.unwrapped.tasks.boards.ink_cells()[0] == 2 * 15 * 15
    with pytest.raises(InvalidInputError, match=r"^drawing has shape \(2, 3\); give a square image"):
        env.reset(options={"drawing": np.ones((2, 3))})


def test_a_start_of_ones_own(env):
    observation, _ = env.reset(seed=0, options={"start": (0.45, 0.05, 0.06)})
    np.testing.assert_allclose(observation["pose"][:3], (0.45, 0.05, 0.06), atol=1e-3)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"start": "left"}, "start is str, not numbers; give 3 finite numbers"),
        ({"start": (0.5, 0.0)}, "start has shape (2,); give 3 finite numbers"),
        ({"start": (0.5, 0.0, np.nan)}, "start[2] = nan; every number must be finite"),
        ({"start": (0.5, 0.0, -0.1)}, "start[2] = -0.1 m is below the board; give 0.01 m or more"),
        ({"start": (9.0, 0.0, 0.1)}, "task 'wiping' needs the tool at"),
        ({"drawing": np.ones((2, 3))}, "drawing has shape (2, 3); give a square image"),
    ],
)
def test_options_that_cannot_be_are_refused_before_the_board_is_wiped(env, options, told):
    env.reset(seed=0)
    before = env.unwrapped.tasks.state_dict()
    with pytest.raises(ContactSafeError) as error:
        env.reset(options=options)
    assert str(error.value).startswith(told)
    np.testing.assert_equal(env.unwrapped.tasks.state_dict(), before)


@pytest.mark.parametrize(
    "fields", [{"clean_fraction": 1.0}, {"start_reach": -0.1}, {"start_height": (0.1, 0.05)}, {"start_height": (-1, 0)}]
)
def test_a_start_that_cannot_be_is_refused(fields):
    with pytest.raises(InvalidInputError, match=next(iter(fields))):
        WipingConfig(**fields)


def test_rendering_is_the_mask_enlarged():
    env = TaskEnv("wiping", SHORT, render_mode="rgb_array")
    observation, _ = env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (512, 512, 3)
    assert_array_equal(picture[::4, ::4, 0], observation["mask"][..., 0])
    assert TaskEnv("wiping", SHORT).render() is None


@pytest.mark.filterwarnings("ignore:.*infinity")
def test_gymnasiums_checker_passes_where_it_renders():
    check_env(gymnasium.make(NAME, config=SHORT, render_mode="rgb_array").unwrapped)


def test_a_vector_environment_renders_all():
    envs = TaskVectorEnv(2, "wiping", SHORT, render_mode="rgb_array")
    seen, _ = envs.reset(seed=0)
    pictures = envs.render()
    assert len(pictures) == 2
    assert_array_equal(pictures[1][::4, ::4, 0], seen["mask"][1, ..., 0])
    envs.close()
