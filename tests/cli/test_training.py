"""`contactsafe train`."""

import importlib.util
import re

import pytest
from tests.cli.mistakes import mistake

from contactsafe.cli import main
from contactsafe.cli.training import KINDS, _task_words
from contactsafe.tasks import DEFAULT_TASK, TASKS


@pytest.mark.parametrize("kind", ["vae", "ppo", "sac"])
def test_training_has_help_of_its_own(kind, capsys):
    pytest.importorskip("torch")
    assert main(["train", kind, "--help"]) == 0
    out = capsys.readouterr().out
    assert "--resume" in out
    chosen = [f"--task {{{','.join(TASKS)},MODULE:NAME}}", *(["{log_polar,tool,paper}"] if kind == "vae" else [])]
    assert all(names in out for names in chosen)
    assert not re.search(r"\bSTR\b|None", out)


def test_a_task_that_does_not_exist_is_told_in_one_line(capsys):
    pytest.importorskip("torch")
    assert main(["train", "ppo", "--task", "cartpole"]) == 2
    assert capsys.readouterr().err == (
        f"contactsafe: --task: 'cartpole' is unknown; choose from {', '.join(TASKS)}, MODULE:NAME; "
        "see contactsafe train ppo --help\n"
    )


@pytest.mark.parametrize("kind", ["vae", "ppo", "sac"])
def test_training_without_the_extra_says_what_to_install(kind, capsys, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "torch" else find(name))
    told = mistake(capsys, "train", kind)
    assert told == "training needs torch; run: pip install 'contactsafe[train]'"


@pytest.mark.parametrize("words", [["train", "--help"], ["train", "-h"]])
def test_help_of_training_names_every_kind_and_every_task(words, capsys):
    assert main(words) == 0
    out = capsys.readouterr().out
    assert f"contactsafe train {{{','.join(KINDS)}}}" in out
    assert all(task in out for task in TASKS)


def test_a_task_without_a_camera_has_no_vision_encoder_to_train(capsys, tmp_path, monkeypatch):
    pytest.importorskip("torch")
    monkeypatch.chdir(tmp_path)
    told = mistake(capsys, "train", "vae", "--task", "insertion")
    assert told == "task 'insertion' has no camera; it needs no vision encoder"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("task", "words"), [(DEFAULT_TASK, ""), ("insertion", " --task insertion")])
def test_the_command_to_go_on_with_names_the_task_where_it_must_be(task, words):
    assert _task_words(task) == words


def test_a_task_whose_module_is_elsewhere_is_told_where_to_run(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = mistake(capsys, "train", "ppo", "--task", "poker:poke")
    assert told.endswith("run the command in the folder of poker.py, or name that folder in PYTHONPATH")


def test_a_training_that_is_stopped_says_how_to_go_on(capsys, tmp_path, monkeypatch):
    pytest.importorskip("torch")

    def stopped(config):
        raise KeyboardInterrupt

    monkeypatch.setattr("contactsafe.learning.train_policy.train_policy", stopped)
    out = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        main(["train", "ppo", "--task", "insertion", "--out", str(out)])
    command = f"contactsafe train ppo --out {out} --resume --task insertion"
    assert f"no bundle yet; {command} goes on, with --max-minutes 0.1 it exports" in capsys.readouterr().err
