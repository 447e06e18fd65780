"""What the README tells a reader to type works."""

import functools
import pathlib
import re
import shlex
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
RUNNABLE = "<!-- runnable -->"
BLOCK = re.compile(rf"^({RUNNABLE}\n+)?```(\w*)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks(*languages: str) -> list[tuple[bool, str]]:
    return [(bool(mark), text) for mark, language, text in BLOCK.findall(README) if language in languages]


def commands(program: str) -> list[str]:
    """Find the shell lines that call a program, joined over backslashes, without prompts and comments."""
    text = "\n".join(text for _, text in blocks("", "sh", "bash", "shell", "console"))
    lines = (line.strip().removeprefix("$ ") for line in text.replace("\\\n", " ").splitlines())
    return list(dict.fromkeys(line for line in lines if line.split(" ")[0] == program))


@functools.cache
def help_of(*words: str) -> str:
    """Return the help text of a subcommand; fails where there is no such subcommand."""
    code = "import sys; from contactsafe.cli import main; sys.exit(main())"
    done = subprocess.run([sys.executable, "-c", code, *words, "--help"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"contactsafe {' '.join(words)} --help: {done.stdout}{done.stderr}"
    return done.stdout


@pytest.mark.parametrize("line", commands("contactsafe"))
def test_contactsafe_command_exists(line):
    words = shlex.split(line, comments=True)[1:]
    subcommand = [word for word in words if not word.startswith("-")][:1]
    text = help_of(*subcommand)
    if subcommand == ["train"]:
        text = help_of(*words[:2])
    for option in (word.split("=")[0] for word in words if word.startswith("--")):
        assert re.search(rf"{re.escape(option)}\b", text), f"{option} is not an option of: {line}"


@pytest.mark.parametrize("line", commands("make"))
def test_make_target_exists(line):
    targets = [word for word in shlex.split(line, comments=True)[1:] if "=" not in word]
    done = subprocess.run(["make", "-n", *targets], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_two_commands_are_named():
    assert {"make demo", "make test"} <= {" ".join(line.split()[:2]) for line in commands("make")}


@pytest.mark.parametrize("text", [text for _, text in blocks("python")])
def test_python_block_compiles(text):
    compile(text, "README.md", "exec")


@pytest.mark.parametrize("text", [text for runnable, text in blocks("python") if runnable])
def test_runnable_python_block_runs(text, tmp_path):
    done = subprocess.run([sys.executable, "-c", text], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\((?!https?:|#|mailto:)([^)#\s]+)", README))))
def test_link_to_a_file_leads_somewhere(target):
    assert (ROOT / target).exists()
