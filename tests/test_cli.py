"""The command line: help that teaches, exit status that can be trusted, one line for a user's mistake."""

import csv
import importlib.util
import io
import json
import re
import shutil
import sys
from typing import get_args

import pytest

import contactsafe
from contactsafe.cli import COMMANDS, main
from contactsafe.control import presets
from contactsafe.core.parse import parse
from contactsafe.experiments.config import PLANTS
from contactsafe.experiments.registry import ENTRIES
from contactsafe.policy.bundle import shipped_bundle
from contactsafe.tasks import ENGINES, TASKS
from contactsafe.tasks.wiping.config import ImageSource
from contactsafe.tasks.wiping.drawings import BOARDS
from contactsafe.tasks.wiping.figures import FIGURES
from contactsafe.tasks.wiping.scripted import SCRIPTED

UNKNOWN = "--{}: 'best' is unknown; choose from vices, paper, safe; see contactsafe {} --help"


def mistake(capsys, *words):
    """Run a command that must fail by its user's fault; return the one line it says."""
    assert main(list(words)) == 1
    out, err = capsys.readouterr()
    assert out == ""
    lines = err.strip().splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("contactsafe: ")
    return lines[0].removeprefix("contactsafe: ")


@pytest.fixture
def bundle(tmp_path):
    return shutil.copytree(shipped_bundle("wiping"), tmp_path / "bundle")


def test_help_lists_every_command_with_what_it_does(capsys):
    for word in ("--help", "-h"):
        assert main([word]) == 0
        text = capsys.readouterr().out
        for name, command in COMMANDS.items():
            assert name in text
            assert command.run.__doc__.strip().splitlines()[0] in text
        assert max(map(len, text.splitlines())) < 100


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name, capsys):
    assert main([name, "--help"]) == 0
    out = capsys.readouterr().out
    assert f"usage: contactsafe {name}" in out
    assert "Traceback" not in out


@pytest.mark.parametrize("kind", ["vae", "ppo", "sac"])
def test_training_has_help_of_its_own(kind, capsys):
    pytest.importorskip("torch")
    assert main(["train", kind, "--help"]) == 0
    out = capsys.readouterr().out
    assert "--resume" in out
    chosen = [f"--task {{{','.join(TASKS)}}}", *(["{log_polar,tool,paper}"] if kind == "vae" else [])]
    assert all(names in out for names in chosen)
    assert not re.search(r"\bSTR\b|None", out)


@pytest.mark.parametrize(
    ("name", "choices"),
    [
        ("demo", {"--controllers": presets.PRESETS}),
        ("experiment", {"": ENTRIES, "--controllers": presets.PRESETS, "--plants": PLANTS}),
        (
            "evaluate",
            {
                "--controller": presets.PRESETS,
                "--boards": BOARDS,
                "--image-source": get_args(ImageSource),
                "--engine": ENGINES,
                "--scripted": SCRIPTED,
                "--task": TASKS,
            },
        ),
        ("bench", {}),
    ],
)
@pytest.mark.parametrize("columns", [80, 120])
def test_help_lists_what_there_is_to_choose_from(name, choices, columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    assert main([name, "--help"]) == 0
    out = capsys.readouterr().out
    for option, names in choices.items():
        assert f"{option} {{{','.join(names)}}}" in out
    assert not re.search(r"\bSTR\b|None", out)
    assert "--bundle PATH" in out or "[PATH]" in out
    assert "(default: the shipped one)" in " ".join(re.sub("[│\\s]+", " ", out).split())
    assert all(len(line) <= columns for line in out.splitlines() if not line.startswith(("usage", "  ")))


@pytest.mark.parametrize("name", ["demo", "experiment", "evaluate", "bench", "train"])
def test_nothing_of_help_is_wider_than_a_terminal(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([name, "--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if len(line) > 80 and not line.startswith("usage")] == []


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"contactsafe {contactsafe.__version__}\n"


def test_no_command_at_all_shows_the_help_and_fails(capsys):
    assert main([]) == 2
    assert "usage: contactsafe COMMAND" in capsys.readouterr().out


def test_an_unknown_command_is_refused(capsys):
    assert main(["dance"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == (
        "contactsafe: command 'dance' is unknown; choose from demo, train, evaluate, experiment, bench, warmup\n"
    )


@pytest.mark.parametrize("words", [["bench", "--fast"], ["experiment"], ["demo", "--trials", "many"], ["train"]])
def test_options_that_do_not_exist_exit_2(words, capsys):
    assert main(words) == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            "evaluate --seed abc",
            "--seed: 'abc' is not a whole number; --seed INT of episodes and noise. (default: 0); "
            "see contactsafe evaluate --help",
        ),
        ("bench --fast", "unknown: --fast; see contactsafe bench --help"),
        (
            "demo --trial 3",
            "unknown: --trial, 3; perhaps you meant --trials INT seeds tried with each controller. (default: 10); "
            "see contactsafe demo --help",
        ),
        (
            "experiment dancing",
            "'dancing' is unknown; choose from task-safety, joint-safety, disturbance, collisions, detection, "
            "adversarial, clock; see contactsafe experiment --help",
        ),
        ("experiment disturbance --controllers safe,best", UNKNOWN.format("controllers", "experiment")),
        ("demo --controllers best", UNKNOWN.format("controllers", "demo")),
        ("evaluate --controller best", UNKNOWN.format("controller", "evaluate")),
        (
            "experiment collisions --plants wet",
            "--plants: 'wet' is unknown; choose from real, clean; see contactsafe experiment --help",
        ),
        (
            "evaluate --boards runes",
            "--boards: 'runes' is unknown; choose from strokes, digits, text, handwriting; "
            "see contactsafe evaluate --help",
        ),
        (
            "evaluate --image-source dream",
            "--image-source: 'dream' is unknown; choose from mask, photograph; see contactsafe evaluate --help",
        ),
        (
            "evaluate --engine steam",
            "--engine: 'steam' is unknown; choose from mujoco, pybullet; see contactsafe evaluate --help",
        ),
        (
            "evaluate --scripted oracle",
            "--scripted: 'oracle' is unknown; choose from raster, nearest-ink, random; see contactsafe evaluate --help",
        ),
        ("evaluate --seed", "--seed: its value is missing; see contactsafe evaluate --help"),
    ],
)
def test_words_that_make_no_sense_are_told_in_one_line_too(words, text, capsys):
    assert main(words.split()) == 2
    out, err = capsys.readouterr()
    assert (out, err) == ("", f"contactsafe: {text}\n")


def test_a_word_in_place_of_a_number_or_nothing_is_told_plainly(capsys):
    assert main(["experiment", "collisions", "--trials", "x"]) == 2
    assert capsys.readouterr().err.startswith("contactsafe: --trials: 'x' is not a whole number; ")


def test_a_task_that_does_not_exist_is_told_in_one_line(capsys):
    pytest.importorskip("torch")
    assert main(["train", "ppo", "--task", "cartpole"]) == 2
    assert capsys.readouterr().err == (
        f"contactsafe: --task: 'cartpole' is unknown; choose from {', '.join(TASKS)}; "
        "see contactsafe train ppo --help\n"
    )


@pytest.mark.parametrize("kind", ["ascii", "utf-8", "terminal"])
def test_a_mistake_is_told_alike_in_pipes_and_terminals(kind, capsys, monkeypatch):
    def asked(trials: int = 0):
        pass

    class Stdout(io.StringIO):
        encoding = "ascii" if kind == "ascii" else "utf-8"

        def isatty(self):
            return kind == "terminal"

    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setattr(sys, "stdout", Stdout())
    with pytest.raises(SystemExit):
        parse(asked, "program", ["--sed", "3"])
    assert capsys.readouterr().err == "contactsafe: unknown: --sed, 3; see program --help\n"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("experiment disturbance --trials 0", "trials = 0; give 1 or more"),
        ("experiment detection --controllers vices", "none of vices reports contacts; choose paper or safe"),
        ("demo --seed -1", "seed = -1; give 0 or more"),
        ("evaluate --episodes 0", "episodes = 0; give 1 or more"),
        ("evaluate --seed -2", "seed = -2; give 0 or more"),
        ("train dog", "'contactsafe train dog' is unknown; choose vae, ppo or sac"),
    ],
)
def test_mistakes_are_told_in_one_line_with_the_remedy(words, text, capsys):
    assert mistake(capsys, *words.split()) == text


@pytest.mark.parametrize("command", ["demo --bundle", "evaluate", "experiment disturbance --bundle", "bench --bundle"])
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


def test_a_bundle_and_a_scripted_policy_are_one_too_many(bundle, capsys):
    told = mistake(capsys, "evaluate", str(bundle), "--scripted", "raster")
    assert told == "a bundle and --scripted raster are both given; name one"


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


@pytest.mark.parametrize("command", ["demo", "experiment disturbance"])
def test_a_folder_that_cannot_be_written_is_told_before_anything_runs(command, bundle, tmp_path, capsys):
    (tmp_path / "file").write_text("not a folder")
    out = tmp_path / "file" / "out"
    told = mistake(capsys, *command.split(), "--bundle", str(bundle), "--out", str(out))
    assert told == f"cannot write to {out}: not a directory; give a folder you may write to with --out"


@pytest.mark.parametrize("kind", ["vae", "ppo", "sac"])
def test_training_without_the_extra_says_what_to_install(kind, capsys, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "torch" else find(name))
    told = mistake(capsys, "train", kind)
    assert told == "training needs torch; run: pip install 'contactsafe[train]'"


def test_json_of_an_experiment_is_all_that_is_on_stdout(bundle, capsys):
    words = "experiment disturbance --trials 1 --controllers vices,safe --seed 4 --json --bundle"
    assert main([*words.split(), str(bundle)]) == 0
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


def test_evaluate_says_how_the_policy_did(bundle, capsys):
    assert main(["evaluate", str(bundle), "--episodes", "2", "--seed", "3", "--json"]) == 0
    results = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert results["seed"] == 3
    assert len(results["records"]) == 2


def test_evaluate_explains_every_figure_it_prints(bundle, capsys):
    assert main(["evaluate", str(bundle), "--episodes", "1", "--seed", "3"]) == 0
    asked, *rows = capsys.readouterr().out.splitlines()
    assert asked.startswith(f"task wiping, policy {bundle}, seed 3, controller safe, pushed False, boards strokes")
    assert [row.split()[0] for row in rows] == [figure.name for figure in FIGURES]
    assert all(figure.doc in row for figure, row in zip(FIGURES, rows, strict=True))
