"""Bundles that commands are given, and what is said where they are none."""

import gymnasium
import pytest
from tests.cli.mistakes import mistake

from contactsafe.cli import common
from contactsafe.cli.common import task_of
from contactsafe.policy.bundle import shipped_bundle
from contactsafe.tasks import DEFAULT_TASK, TASKS, register_task
from contactsafe.tasks.base.registry import env_id
from contactsafe.tasks.wiping.tasks import WipingTasks


@pytest.mark.parametrize("command", ["demo --bundle", "evaluate", "experiment task-safety --bundle", "bench --bundle"])
def test_a_missing_bundle_is_told(command, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    missing = tmp_path / "nothing"
    told = mistake(capsys, *command.split(), str(missing))
    assert told == f"no bundle at {missing}: not a folder; give the path of a folder that holds bundle.json"
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_bundle_is_told_and_nothing_is_written(bundle, tmp_path, capsys):
    data = bytearray((bundle / "policy.onnx").read_bytes())
    data[len(data) // 2] ^= 1
    (bundle / "policy.onnx").write_bytes(data)
    told = mistake(capsys, "demo", "--bundle", str(bundle), "--out", str(tmp_path / "out"))
    assert told == (
        f"{bundle / 'policy.onnx'} is not the file bundle.json was written for (size or SHA-256 differ); "
        "copy or export the bundle anew"
    )
    assert not (tmp_path / "out").exists()


def test_a_bundle_that_is_not_whole_is_told(bundle, capsys):
    (bundle / "policy.onnx").unlink()
    told = mistake(capsys, "evaluate", str(bundle))
    assert told == f"{bundle / 'policy.onnx'} is missing; the bundle is incomplete, copy or export it anew"


@pytest.mark.parametrize("named", ["run", "run/bundle"])
def test_a_run_without_a_bundle_is_told_how_to_leave_one(named, tmp_path, capsys):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "checkpoint.pt").write_bytes(b"")
    told = mistake(capsys, "evaluate", str(tmp_path / named))
    assert told == (
        f"the run in {tmp_path / 'run'} has left no bundle yet; once it is stopped, the command that began it, with "
        "--resume --max-minutes 0.1, has it leave what it has learned"
    )


def test_an_encoder_in_place_of_a_policy_is_told(tmp_path, capsys):
    (tmp_path / "encoder.json").write_text("{}")
    assert mistake(capsys, "evaluate", str(tmp_path)) == (
        f"{tmp_path} holds a vision encoder, not a policy; "
        f"run `contactsafe train ppo --encoder {tmp_path}`, which leaves a bundle"
    )


def test_a_run_in_place_of_its_bundle_is_told(bundle, tmp_path, capsys):
    assert mistake(capsys, "evaluate", str(tmp_path)) == f"{tmp_path} is a run; give its bundle, {bundle}"


@pytest.mark.parametrize("command", ["demo --bundle", "evaluate", "experiment task-safety --bundle", "bench --bundle"])
def test_a_bundle_of_another_task_is_refused_with_the_option_that_is_missing(command, capsys):
    folder = shipped_bundle("wiping")
    told = mistake(capsys, *command.split(), str(folder), "--task", "insertion")
    assert told == f"{folder} is a policy for the task wiping, not for insertion; give --task wiping"


class PressTasks(WipingTasks):
    """A task of a user's own."""

    name = "press"


@pytest.mark.parametrize("command", ["demo", "evaluate", "experiment task-safety", "bench"])
def test_a_task_without_a_shipped_policy_was_told_of_a_folder_in_the_package(command, capsys):
    try:
        register_task("press", f"{__name__}:PressTasks")
        told = mistake(capsys, *command.split(), "--task", "press")
        assert told == "no policy is shipped for task 'press'; give the folder of a bundle"
    finally:
        TASKS.pop("press", None)
        gymnasium.registry.pop(env_id("press"), None)


@pytest.mark.parametrize(
    ("words", "task"),
    [
        ([], DEFAULT_TASK),
        (["--task", "insertion"], "insertion"),
        (["--seed", "3", "--task=insertion"], "insertion"),
        (["--task", "cartpole"], DEFAULT_TASK),
        (["--task"], DEFAULT_TASK),
        (["insertion"], DEFAULT_TASK),
    ],
)
def test_the_task_is_what_the_words_name(words, task):
    """Unknown names are left to the parser, which says what there is."""
    assert task_of(words) == task


@pytest.mark.parametrize("new", [True, False])
def test_a_progress_bar_says_that_it_compiles_only_where_it_does(new, monkeypatch):
    monkeypatch.setattr(common, "first_run", lambda: new)
    assert common.described("rounds") == (f"rounds ({common.COMPILES})" if new else "rounds")
