"""The command line: the one place that composes everything. One module a group of commands."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import contactsafe
from contactsafe.cli.calibrate import calibrate
from contactsafe.cli.common import first_run
from contactsafe.cli.evaluation import evaluate
from contactsafe.cli.experiments import demo, experiment
from contactsafe.cli.identification import identify, record
from contactsafe.cli.logs import replay
from contactsafe.cli.machine import bench, warmup
from contactsafe.cli.robot import run
from contactsafe.cli.training import train
from contactsafe.core import process
from contactsafe.core.errors import ContactSafeError
from contactsafe.core.parse import call, docstring
from contactsafe.tasks import import_task


@dataclass(frozen=True)
class _Command:
    """A command; one that parses is called with its words."""

    run: Callable
    parses: bool = False


COMMANDS = {
    "demo": _Command(demo),
    "train": _Command(train, parses=True),
    "evaluate": _Command(evaluate, parses=True),
    "experiment": _Command(experiment, parses=True),
    "replay": _Command(replay, parses=True),
    "identify": _Command(identify, parses=True),
    "record": _Command(record, parses=True),
    "calibrate": _Command(calibrate, parses=True),
    "run": _Command(run, parses=True),
    "bench": _Command(bench),
    "warmup": _Command(warmup),
}


def _help() -> str:
    lines = ["usage: contactsafe COMMAND [options]", ""]
    for name, command in COMMANDS.items():
        lines.append(f"  {name:12s}{docstring(command.run).partition(chr(10))[0]}")
    return "\n".join([*lines, "", "`contactsafe COMMAND --help` says more; `contactsafe --version` gives the version."])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; exit status 0 only when it did its job.

    Args:
        arguments: words after `contactsafe`. Where None, this process is the program: the words are its own, and so are
            streams and signals, see `contactsafe.core.process.run`.

    Returns:
        The exit status: 0, 1 where the command said in one line what is wrong, 2 where the words make no sense.
    """
    if arguments is None:
        return process.run(lambda: _main(sys.argv[1:]))
    return _main(arguments)


def _with_tasks_imported(words: Sequence[str]) -> list[str]:
    """Import the tasks that words name as `--task module:name`; return the words with the names alone."""
    known = list(words)
    for k, word in enumerate(words):
        option, equals, value = word.partition("=")
        if option != "--task":
            continue
        if equals and ":" in value:
            known[k] = f"--task={import_task(value)}"
        elif not equals and ":" in "".join(words[k + 1 : k + 2]):
            known[k + 1] = import_task(words[k + 1])
    return known


def _main(words: Sequence[str]) -> int:
    first_run()
    if not words or words[0] in ("-h", "--help"):
        print(_help())
        return 0 if words else 2
    if words[0] == "--version":
        print(f"contactsafe {contactsafe.__version__}")
        return 0
    if words[0] not in COMMANDS:
        print(f"contactsafe: command '{words[0]}' is unknown; choose from {', '.join(COMMANDS)}", file=sys.stderr)
        return 2
    command = COMMANDS[words[0]]
    try:
        words = _with_tasks_imported(words)
        if command.parses:
            command.run(words[1:])
        else:
            call(command.run, f"contactsafe {words[0]}", words[1:])
    except ContactSafeError as error:
        print(f"contactsafe: {error}", file=sys.stderr)
        return 1
    except SystemExit as stop:  # tyro's, which has said why
        return stop.code if isinstance(stop.code, int) else 0
    return 0
