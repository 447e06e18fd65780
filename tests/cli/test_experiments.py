"""`contactsafe demo` and `contactsafe experiment`."""

import csv
import json
import shlex
import sys

import gymnasium
import pytest
from tests.cli.mistakes import mistake

from contactsafe.cli import experiments, main
from contactsafe.cli.experiments import Options, _command, _config, scenes_of
from contactsafe.cli.training import _task_words
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.registry import ENTRIES
from contactsafe.tasks import DEFAULT_TASK, TASKS, import_task
from contactsafe.tasks.base.registry import env_id
from contactsafe.tasks.base.task import Task
from contactsafe.tasks.wiping.tasks import WipingTasks


def test_a_word_in_place_of_a_number_or_nothing_is_told_plainly(capsys):
    assert main(["experiment", "collisions", "--trials", "x"]) == 2
    assert capsys.readouterr().err.startswith("contactsafe: --trials: 'x' is not a whole number; ")


@pytest.mark.parametrize("command", ["demo", "experiment task-safety"])
def test_a_folder_that_cannot_be_written_is_told_before_anything_runs(command, bundle, tmp_path, capsys):
    (tmp_path / "file").write_text("not a folder")
    out = tmp_path / "file" / "out"
    told = mistake(capsys, *command.split(), "--bundle", str(bundle), "--out", str(out))
    assert told == f"cannot write to {out}: not a directory; give a folder you may write to with --out"


def test_json_of_an_experiment_is_all_that_is_on_stdout(capsys):
    words = "experiment disturbance --trials 1 --controllers vices,safe --seed 4 --json"
    assert main(words.split()) == 0
    out, err = capsys.readouterr()
    summary = json.loads(out, parse_constant=pytest.fail)
    experiment = summary["experiments"]["disturbance"]
    assert len(experiment["spread"]) == 6
    assert {trial["seed"] for trial in experiment["trials"]} == {4}
    assert {trial["controller"] for trial in experiment["trials"]} == {"vices", "safe"}
    assert "disturbance" in err  # the progress bar


def test_collisions_need_no_bundle_and_leave_page_summary_and_a_row_a_trial(tmp_path, capsys, monkeypatch):
    def load(*_):
        pytest.fail("a bundle was asked for")

    monkeypatch.setattr("contactsafe.policy.bundle.Bundle.load", load)
    words = "experiment collisions --trials 2 --controllers vices,safe --seed 4 --out"
    assert main([*words.split(), str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    assert "peak regressions against vices" in out
    assert "--trials 1 --out trial-4 --seed 4" in out
    assert "4/4" not in err
    assert "8/8" in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["collisions.csv", "report.html", "summary.json"]
    with open(tmp_path / "collisions.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    cases = [(row["seed"], row["plant"], row["controller"]) for row in rows]
    assert sorted(cases) == sorted(
        (seed, plant, name) for seed in "45" for plant in ("real", "clean") for name in ("vices", "safe")
    )
    summary = json.loads((tmp_path / "summary.json").read_text(), parse_constant=pytest.fail)
    trial = summary["experiments"]["collisions"]["trials"][0]
    row = next(
        r for r in rows if (r["seed"], r["plant"], r["controller"]) == ("4", trial["plant"], trial["controller"])
    )
    assert float(row["contact_peak_n"]) == pytest.approx(trial["metrics"]["contact_peak_n"], rel=1e-5)


def test_json_of_collisions_has_the_verdict(capsys):
    words = "experiment collisions --trials 1 --controllers vices,safe --plants clean --json"
    assert main(words.split()) == 0
    summary = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert summary["command"].endswith("--trials 1 --seed 0 --controllers vices,safe --plants clean")
    assert "bundle_sha256" not in summary
    verdict = {row["figure"]: row for row in summary["experiments"]["collisions"]["tables"]["verdict"]}
    assert verdict["trials compared"]["safe, clean"] == 1


def test_a_preset_with_other_parameters_is_compared_under_the_name_that_was_given(capsys):
    words = "experiment collisions --trials 1 --controllers vices,safe:tank_j=2:passive_gains=no --plants clean --json"
    assert main(words.split()) == 0
    summary = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    trials = summary["experiments"]["collisions"]["trials"]
    assert {trial["controller"] for trial in trials} == {"vices", "safe:tank_j=2:passive_gains=no"}
    assert "--controllers vices,safe:tank_j=2:passive_gains=no" in summary["command"]


@pytest.mark.parametrize(
    ("preset", "told"),
    [
        ("gentle:tank_j=2", "controller 'gentle' is unknown; choose from vices, paper, safe"),
        ("safe:tank=2", "parameter 'tank' is unknown; did you mean 'tank_s'?"),
        ("safe:tank_j", "'tank_j' in 'safe:tank_j' has no value; write parameter=value"),
        ("safe:dwell_s=-1", "dwell_s = -1.0 has a negative number or NaN"),
    ],
)
@pytest.mark.parametrize("command", ["experiment collisions", "demo"])
def test_a_preset_with_a_parameter_that_cannot_be_is_told_in_one_line(command, preset, told, capsys):
    assert main([*command.split(), "--controllers", f"vices,{preset}"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("contactsafe: --controllers: ")
    assert told in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("entry", ENTRIES.values(), ids=ENTRIES)
def test_options_left_out_are_those_of_the_experiment(entry):
    config = _config(Options(entry.name, seed=3), entry)
    assert list(config.seeds) == list(range(3, 3 + entry.trials))
    assert (config.bundle is not None) == ("bundle" in entry.takes)
    assert (config.task is not None) == ("task" in entry.takes)


OPTIONS = {
    "task": "insertion", "bundle": "folder", "plants": "clean", "sensors": "franka", "minutes": "2", "models": "a.xml",
}  # fmt: skip


@pytest.mark.parametrize("entry", ENTRIES.values(), ids=ENTRIES)
@pytest.mark.parametrize("option", OPTIONS)
def test_an_option_that_an_experiment_does_not_take_was_ignored_and_recorded(entry, option, capsys):
    assert set(entry.takes) <= set(OPTIONS)
    if option in entry.takes:
        return
    told = mistake(capsys, "experiment", entry.name, f"--{option}", OPTIONS[option])
    assert told == f"experiment {entry.name} takes no --{option}; leave that out"


def test_all_options_that_are_not_taken_are_told_at_once(capsys):
    told = mistake(capsys, *["experiment", "clock", "--minutes", "3", "--task", "insertion"])
    assert told == "experiment clock takes no --task and no --minutes; leave that out"


def test_an_experiment_without_a_task_was_refused_for_a_task_without_scenes(monkeypatch):
    monkeypatch.setattr(experiments, "task_by_name", lambda name: Task(WipingTasks))
    assert _config(Options("collisions"), ENTRIES["collisions"]).task is None


def test_trials_that_are_asked_for_count_more_than_the_usual_ones():
    assert len(_config(Options("collisions", trials=2), ENTRIES["collisions"]).seeds) == 2
    with pytest.raises(InvalidInputError, match="trials = 0; give 1 or more"):
        _config(Options("collisions", trials=0), ENTRIES["collisions"])


def test_the_command_on_the_page_names_what_was_not_the_default():
    usual = _command("demo", ExperimentConfig(), DEFAULT_TASK, None)
    assert usual == "contactsafe demo --trials 10 --seed 0 --controllers " + ",".join(ExperimentConfig.controllers)
    other = _command("demo", ExperimentConfig(minutes=2.5, plants=("real",)), "insertion", None)
    assert other == usual + " --task insertion --plants real --minutes 2.5"


def test_the_command_on_the_page_left_the_bundle_out(bundle, tmp_path, capsys):
    folder = bundle.rename(tmp_path / "my bundle")
    words = "experiment task-safety --trials 1 --controllers safe --json --bundle"
    assert main([*words.split(), str(folder)]) == 0
    command = json.loads(capsys.readouterr().out)["command"]
    assert shlex.split(command)[-2:] == ["--bundle", str(folder)]


def test_the_command_on_the_page_named_a_task_of_ones_own_as_nobody_can_call_it(tmp_path, monkeypatch):
    (tmp_path / "pressing.py").write_text(
        "from contactsafe.tasks import register_task\nregister_task('press', 'pressing:PressTasks')\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    try:
        assert import_task("pressing:press") == "press"
        assert " --task pressing:press" in _command("demo", ExperimentConfig(), "press", None)
        assert _task_words("press") == " --task pressing:press"
    finally:
        sys.modules.pop("pressing", None)
        TASKS.pop("press", None)
        gymnasium.registry.pop(env_id("press"), None)


@pytest.mark.parametrize("task", TASKS)
def test_every_task_of_the_package_has_scenes_for_experiments(task):
    scenes = scenes_of(task)
    assert scenes.name
    assert scenes.policy


def test_a_task_without_scenes_is_told_where_to_read_on(monkeypatch):
    monkeypatch.setattr(experiments, "task_by_name", lambda name: Task(WipingTasks))
    with pytest.raises(InvalidInputError, match="task 'wiping' has no scenes for experiments; see docs/"):
        scenes_of("wiping")
