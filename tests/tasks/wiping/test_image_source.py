"""Boards by kind and masks by way of photographs, as the environment's configuration asks for."""

import subprocess
import sys
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from numpy.testing import assert_array_equal

import contactsafe  # noqa: F401 -- registers the task
from contactsafe.core.errors import InvalidInputError
from contactsafe.tasks.wiping.config import WipingConfig
from contactsafe.tasks.wiping.tasks import WipingTasks

NAME = "contactsafe/Wiping-v0"
PHOTOGRAPHED = WipingConfig(boards="handwriting", image_source="photograph", episode_s=0.1)


def agreement(a, b):
    return ((a == 0) & (b == 0)).sum() / ((a == 0) | (b == 0)).sum()


def test_boards_are_of_the_kind_asked_for_and_the_seeds():
    env = gymnasium.make(NAME, config=WipingConfig(boards="handwriting"))
    first, _ = env.reset(seed=2)
    other, _ = env.reset(seed=3)
    again, _ = env.reset(seed=2)
    assert_array_equal(first["mask"], again["mask"])
    assert not np.array_equal(first["mask"], other["mask"])
    strokes, _ = gymnasium.make(NAME).reset(seed=2)
    assert not np.array_equal(first["mask"], strokes["mask"])


def test_a_drawing_of_ones_own_wins():
    env = gymnasium.make(NAME, config=WipingConfig(boards="digits"))
    env.reset(seed=0, options={"drawing": np.ones((1, 1))})
    assert env.unwrapped.tasks.boards.ink_cells()[0] == 150**2


def test_the_image_source_changes_no_board_and_no_start():
    plain, seen = (gymnasium.make(NAME, config=WipingConfig(image_source=of)) for of in ("mask", "photograph"))
    (a, _), (b, _) = plain.reset(seed=5), seen.reset(seed=5)
    assert_array_equal(plain.unwrapped.tasks.boards.cells, seen.unwrapped.tasks.boards.cells)
    assert_array_equal(a["pose"], b["pose"])
    assert agreement(a["mask"], b["mask"]) > 0.6
    assert plain.unwrapped.tasks.tasks["light"][0] == 0


def test_masks_through_photographs_are_masks_and_follow_the_arm():
    env = gymnasium.make(NAME, config=replace(PHOTOGRAPHED, episode_s=5.0))
    observation, _ = env.reset(seed=1)
    masks = [observation["mask"]]
    for _ in range(20):
        masks.append(env.step(np.r_[1.0, np.zeros(17)].astype(np.float32))[0]["mask"])
        tasks = env.unwrapped.tasks
        assert set(np.unique(masks[-1])) <= {0, 255}
    assert agreement(masks[-1][..., 0], tasks.boards.render(tasks.worlds.records)[0]) > 0.6
    assert not np.array_equal(masks[0], masks[-1])


def test_where_the_arm_hides_the_board_is_known_by_its_encoders():
    """Encoders that are off move the silhouette that is masked out, while the photograph stays what it was."""
    tasks = WipingTasks(PHOTOGRAPHED)
    tasks.reset(0, np.random.default_rng(1), drawing=np.ones((1, 1)), start=(0.5, 0.0, 0.05))
    before, picture = tasks.boards.masks[0].copy(), tasks._photographs.photograph(0, tasks.tasks[0])
    tasks.worlds.records[0]["errors"]["q_seen"][0] += 0.2
    tasks.observe(0)
    assert not np.array_equal(tasks.boards.masks[0], before)
    assert_array_equal(tasks._photographs.photograph(0, tasks.tasks[0]), picture)


def test_many_environments_see_what_each_would_see_alone():
    envs = gymnasium.make_vec(NAME, num_envs=3, config=PHOTOGRAPHED)
    together, _ = envs.reset(seed=30)
    for i in range(3):
        alone, _ = gymnasium.make(NAME, config=PHOTOGRAPHED).reset(seed=30 + i)
        assert_array_equal(together["mask"][i], alone["mask"])
    for _ in range(7):  # past the end of the episode
        observation, *_ = envs.step(np.zeros((3, 18), np.float32))
        assert observation["mask"].shape == (3, 128, 128, 1)
    envs.close()


def test_light_and_noise_follow_from_the_tasks_record_alone():
    """Nothing else need be kept to go on as before."""
    tasks, others = WipingTasks(PHOTOGRAPHED), WipingTasks(PHOTOGRAPHED)
    for one, seed in ((tasks, 1), (others, 2)):
        one.reset(0, np.random.default_rng(seed), drawing=np.eye(5), start=(0.5, 0.1, 0.05))
    assert not np.array_equal(tasks.boards.masks, others.boards.masks)
    others.tasks["light"] = tasks.tasks["light"]
    others.observe(0)
    assert_array_equal(tasks.boards.masks, others.boards.masks)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"boards": "crayon"}, "boards = 'crayon'; choose strokes, digits, text or handwriting"),
        ({"image_source": "x-ray"}, "image_source = 'x-ray'; choose mask or photograph"),
    ],
)
def test_other_kinds_are_refused(fields, text):
    with pytest.raises(InvalidInputError) as caught:
        WipingConfig(**fields)
    assert str(caught.value) == text


def test_without_opencv_the_remedy_is_named():
    code = (
        "import sys; sys.modules['cv2'] = None\n"
        "import contactsafe.tasks.wiping.tasks\n"
        "try:\n    import contactsafe.tasks.wiping.photographs\n"
        "except contactsafe.ContactSafeError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "photographs need OpenCV; run: pip install 'contactsafe[camera]'", done.stderr
