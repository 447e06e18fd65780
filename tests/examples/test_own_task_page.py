"""The page on tasks of one's own: its task is learned, evaluated and run in either engine, by its name."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "howto" / "own_task.md").read_text(encoding="utf-8")

USE = """
import numpy as np, gymnasium, press
from contactsafe.tasks import make_vec

def episode(env, push):
    observation, _ = env.reset(seed=3)
    while True:
        action, force = np.zeros(18, np.float32), observation["force"][2]
        action[2] = -0.5 if force < 1.0 else np.clip(push * (force - 8.0), -0.3, 0.3)
        observation, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return bool(info["is_success"]), float(info["held_s"])

for engine in ("mujoco", "pybullet"):
    print(*episode(gymnasium.make("contactsafe/Press-v0", engine=engine), 0.02))
print(*episode(gymnasium.make("contactsafe/Press-v0", config=press.PressConfig(force_n=30.0)), 0.02))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    (task,) = re.findall(r"<!-- runnable: press.py -->\n```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    folder = tmp_path_factory.mktemp("own_task")
    (folder / "press.py").write_text(task, encoding="utf-8")
    return folder


def run(folder, *words):
    done = subprocess.run([sys.executable, *words], cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


def test_what_the_page_shows_runs(folder):
    (code,) = re.findall(r"<!-- runnable -->\n```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    status, _, told = run(folder, "-c", code)
    assert status == 0, told


def test_a_button_held_with_the_stated_force_is_a_success_in_either_engine_and_with_another_is_none(folder):
    pytest.importorskip("pybullet")
    status, printed, told = run(folder, "-c", USE)
    assert status == 0, told
    words = [line.split() for line in printed.splitlines() if line.startswith(("True", "False"))]
    assert [word[0] for word in words] == ["True", "True", "False"]
    assert float(words[0][1]) >= 0.5


def test_training_and_evaluation_take_it_by_module_and_name(folder):
    train = ["train", "ppo", "--task", "press:press", "--num-envs", "4", "--rollout-steps", "32", "--batch", "64"]
    status, printed, told = run(
        folder, "-m", "contactsafe", *train, "--total-steps", "256", "--evaluate-episodes", "2", "--out", "run"
    )
    assert status == 0, told
    status, printed, told = run(
        folder, "-m", "contactsafe", "evaluate", "run/bundle", "--task=press:press", "--episodes", "2", "--json"
    )
    assert status == 0, told
    assert json.loads(printed)["task"] == "press"


@pytest.mark.parametrize(
    ("task", "told"),
    [
        (
            "nowhere:press",
            r"task 'nowhere:press': module nowhere cannot be imported: .*; run the command in the folder of .*",
        ),
        ("press:push", r"task 'press:push': press registers no task 'push'; it needs register_task"),
    ],
)
def test_a_task_that_cannot_be_found_is_told_in_one_line(folder, task, told):
    status, _, error = run(folder, "-m", "contactsafe", "evaluate", "--task", task, "--scripted", "random")
    assert status == 1
    assert re.fullmatch(rf"contactsafe: {told}\n", error)
