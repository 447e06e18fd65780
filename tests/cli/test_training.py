"""`contactsafe train`."""

import importlib.util
import json
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


@pytest.mark.parametrize("begun", [True, False])
@pytest.mark.parametrize("kind", ["vae", "ppo"])
def test_a_training_that_is_stopped_says_how_to_go_on_where_it_can(kind, begun, capsys, tmp_path, monkeypatch):
    pytest.importorskip("torch")
    out = tmp_path / "my run"

    def stopped(config, *_):
        if begun:
            out.mkdir()
            (out / "checkpoint.pt").write_bytes(b"")
        raise KeyboardInterrupt

    module = "train_vae" if kind == "vae" else "train_policy"
    monkeypatch.setattr(f"contactsafe.learning.{module}.{module}", stopped)
    with pytest.raises(KeyboardInterrupt):
        main(["train", kind, "--out", str(out)])
    said = f"contactsafe: contactsafe train {kind} --out '{out}' --resume goes on from here\n"
    assert (said in capsys.readouterr().err) == begun


def test_the_last_evaluation_of_a_training_met_other_episodes_than_the_command(capsys, tmp_path):
    pytest.importorskip("torch")
    words = "--task insertion --total-steps 64 --num-envs 8 --rollout-steps 8 --batch 64 --evaluate-episodes 6 --seed 3"
    assert main(["train", "ppo", *words.split(), "--out", str(tmp_path / "run")]) == 0
    bundle = tmp_path / "run" / "bundle"
    capsys.readouterr()
    assert main(["evaluate", str(bundle), *["--task", "insertion", "--episodes", "6", "--seed", "3", "--json"]]) == 0
    printed = json.loads(capsys.readouterr().out)
    results = json.loads((bundle / "bundle.json").read_text(encoding="utf-8"))["results"]
    assert results == {name: printed[name] for name in results}
