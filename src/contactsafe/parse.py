"""Words of a command line turned into values by tyro; what a user got wrong is told in one line."""

import contextlib
import functools
import io
import re
import sys
from collections.abc import Callable, Sequence
from typing import Any

import tyro

_PLAINER = {
    r"Error parsing (--[\w.-]+): ": r"\1: ",
    r"Error parsing \w+: ": "",
    r"invalid literal for int\(\) with base 10: ('.*?')": r"\1 is not a whole number",
    r"Could not find valid parse for arguments: (\[.*?\])": r"\1 makes no sense",
    r"could not convert string to float: ('.*?')": r"\1 is not a number",
    r" Argument helptext: (--[\w.-]+)": r"; \1",
    r"Missing from [\w ]+: ": "missing: ",
    r"Unrecognized options: ": "unknown: ",
    r" Perhaps you meant: ": "; perhaps you meant ",
}
"""What tyro says, and how it is said here."""


def parse(what: Callable, program: str, words: Sequence[str], **options: Any) -> Any:
    """Turn words into what a dataclass or a function's arguments ask for.

    Args:
        what: dataclass to make, or function to call with what was said.
        program: how the command is called, for help and messages.
        words: after it.
        options: of `tyro.cli`.

    Raises:
        SystemExit: help was asked for (0), or a word makes no sense (2) and one line on stderr has said so.
    """
    told = io.StringIO()
    try:
        with contextlib.redirect_stderr(told):
            asked = tyro.cli(what, prog=program, args=list(words), **options)
    except SystemExit as stop:
        if stop.code:
            print(f"contactsafe: {_one_line(told.getvalue())}; see {program} --help", file=sys.stderr)
        raise
    print(told.getvalue(), end="", file=sys.stderr)
    return asked


def call(function: Callable, program: str, words: Sequence[str]) -> None:
    """Call a function with the arguments that words name; its own messages are its own."""

    @functools.wraps(function)
    def later(*args: Any, **kwargs: Any) -> Callable:
        return functools.partial(function, *args, **kwargs)

    parse(later, program, words)()


def _one_line(box: str) -> str:
    """Take title and frame off a message of tyro's, and what it says of help."""
    plain = re.sub(r"\x1b\[[\d;]*m", "", box)  # in a terminal it has colours
    inner = [line.strip("│ ") for line in plain.splitlines()[1:]]
    text = re.sub(r"\s+", " ", " ".join(line for line in inner if line.strip("╰╯─-")))
    text = text.partition("For full helptext")[0].strip()
    for found, said in _PLAINER.items():
        text = re.sub(found, said, text)
    return text.rstrip(".; ")
