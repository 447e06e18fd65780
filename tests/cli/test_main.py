"""The commands as a whole: help that teaches, exit status that can be trusted, one line for a user's mistake."""

import io
import re
import sys
from typing import get_args

import gymnasium
import pytest
from tests.cli.mistakes import mistake

import contactsafe
from contactsafe.cli import COMMANDS, _with_tasks_imported, main
from contactsafe.control import presets
from contactsafe.core.parse import parse
from contactsafe.experiments.config import PLANTS
from contactsafe.experiments.registry import ENTRIES
from contactsafe.tasks import ENGINES, TASKS
from contactsafe.tasks.base import registry
from contactsafe.tasks.base.registry import TASK_FORM
from contactsafe.tasks.wiping.config import ImageSource
from contactsafe.tasks.wiping.drawings import BOARDS
from contactsafe.tasks.wiping.scripted import SCRIPTED

UNKNOWN = "--{}: 'best' is unknown; choose from vices, paper, safe, NAME:PARAMETER=VALUE; see contactsafe {} --help"

CONTROLLERS = [*presets.PRESETS, presets.FORM]


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


@pytest.mark.parametrize(
    ("name", "choices"),
    [
        ("demo", {"--controllers": CONTROLLERS}),
        ("experiment", {"": ENTRIES, "--controllers": CONTROLLERS, "--plants": PLANTS}),
        (
            "evaluate",
            {
                "--controller": CONTROLLERS,
                "--boards": BOARDS,
                "--image-source": get_args(ImageSource),
                "--engine": ENGINES,
                "--scripted": SCRIPTED,
                "--task": [*TASKS, TASK_FORM],
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
    known = "demo, train, evaluate, experiment, replay, identify, record, calibrate, run, bench, warmup"
    assert err == f"contactsafe: command 'dance' is unknown; choose from {known}\n"


@pytest.mark.parametrize("words", [["bench", "--fast"], ["experiment"], ["demo", "--trials", "many"], ["train"]])
def test_options_that_do_not_exist_exit_2(words, capsys):
    assert main(words) == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            "evaluate --seed abc",
            "--seed: 'abc' is not a whole number; see contactsafe evaluate --help",
        ),
        ("bench --fast", "unknown: --fast; see contactsafe bench --help"),
        (
            "demo --trial 3",
            "unknown: --trial, 3; perhaps you meant --trials; see contactsafe demo --help",
        ),
        (
            "experiment dancing",
            "'dancing' is unknown; choose from task-safety, joint-safety, disturbance, collisions, detection, "
            "pushes, localisation, adversarial, clock, robots; see contactsafe experiment --help",
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


PRESS = """
from contactsafe.tasks.base.registry import register_task
register_task("press", "contactsafe.tasks.wiping.tasks:WipingTasks")
"""
"""A module that registers a task, as a user's own does."""


@pytest.fixture
def press(tmp_path, monkeypatch):
    """Let the current folder hold press.py, and forget what importing it leaves."""
    (tmp_path / "press.py").write_text(PRESS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    before = list(sys.path)
    yield
    assert sys.path == before
    sys.modules.pop("press", None)
    TASKS.pop("press", None)
    gymnasium.registry.pop(registry.env_id("press"), None)


@pytest.mark.parametrize(
    ("words", "known"),
    [
        (["evaluate", "--task", "press:press"], ["evaluate", "--task", "press"]),
        (["evaluate", "--task=press:press", "--seed", "3"], ["evaluate", "--task=press", "--seed", "3"]),
    ],
)
def test_a_task_that_is_named_by_module_is_imported_from_the_current_folder(words, known, press):
    assert "press" not in TASKS
    assert _with_tasks_imported(words) == known
    assert TASKS["press"] == "contactsafe.tasks.wiping.tasks:WipingTasks"


@pytest.mark.parametrize(
    "words",
    [[], ["demo"], ["evaluate", "--task"], ["evaluate", "--task", "wiping"], ["experiment", "--controllers", "a:b=1"]],
)
def test_other_words_stay_as_they_are_and_import_nothing(words, press):
    assert _with_tasks_imported(words) == words
    assert "press" not in sys.modules


@pytest.mark.parametrize(
    ("task", "told"),
    [
        ("nowhere:press", "module nowhere cannot be imported"),
        ("press:push", "press registers no task 'push'; it needs register_task"),
    ],
)
@pytest.mark.parametrize("command", ["demo", "experiment disturbance", "evaluate", "bench", "train ppo"])
def test_a_task_that_cannot_be_found_is_told_by_every_command(command, task, told, press, capsys):
    assert told in mistake(capsys, *command.split(), "--task", task)


@pytest.mark.parametrize("command", ["demo", "experiment disturbance", "evaluate", "bench"])
def test_a_task_that_nobody_registered_is_refused_with_those_there_are(command, capsys):
    assert main([*command.split(), "--task", "cartpole"]) == 2
    name = command.split()[0]
    assert capsys.readouterr().err == (
        f"contactsafe: --task: 'cartpole' is unknown; choose from {', '.join(TASKS)}, MODULE:NAME; "
        f"see contactsafe {name} --help\n"
    )
