"""Words of a command line turned into values by tyro; what a user got wrong is told in one line."""

import ast
import contextlib
import dataclasses
import functools
import inspect
import io
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any

import tyro
from tyro.constructors import PrimitiveConstructorSpec

_PLAINER: dict[str, str | Callable[[re.Match], str]] = {
    r"Error parsing (--[\w.-]+): ": r"\1: ",
    r"Error parsing (\w+|\{.*?\}): ": "",
    r"Missing value for argument '(.*?)'\. Expected .*": r"\1: its value is missing",
    r"no type matching \S+ could be instantiated from \['.*?'\]\. Got errors: - <class '\w+'>: ": "",
    r"invalid literal for int\(\) with base 10: ('.*?')": r"\1 is not a whole number",
    r"Could not find valid parse for arguments: (\[.*?\])": r"\1 makes no sense",
    r"could not convert string to float: ('.*?')": r"\1 is not a number",
    r"invalid choice ('.*?') for argument '(.*?)'\. Expected one of \((.*?)\)": (
        lambda found: f"{found[2]}: {found[1]} is unknown; choose from {found[3].replace(chr(39), '')}"
    ),
    r"\.? Argument helptext: .*": "",
    r"Missing from [\w ]+: ": "missing: ",
    r" \(required\)": "",
    r"Unrecognized options: ": "unknown: ",
    r" Perhaps you meant: (--[\w-]+).*": r"; perhaps you meant \1",
}
"""What tyro says, and how it is said here."""


def one_of(
    names: Collection[str], check: Callable[[str], Any] | None = None, also: str = ""
) -> PrimitiveConstructorSpec:
    """Say in `Annotated` of a text that it is one of some names: help lists them, and no other passes.

    Args:
        names: all there are, from where they are defined.
        check: raises ValueError for a text that does not pass, where a name may have more behind it; None for names.
        also: what else may be said, by its form.
    """
    known = names
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=_metavar(known, ",", also),
        instance_from_str=lambda words: _checked(words[0], known, check, also),
        is_instance=lambda value: value is None or value in known or (check is not None and isinstance(value, str)),
        str_from_instance=lambda value: [str(value)],
    )


def some_of(
    names: Iterable[str], separator: str = ",", check: Callable[[str], Any] | None = None, also: str = ""
) -> PrimitiveConstructorSpec:
    """Say of a tuple that it holds some of some names; see `one_of`.

    Args:
        names: all there are, from where they are defined.
        separator: what stands between them on the command line, a comma or a space.
        check, also: as of `one_of`.
    """
    known = tuple(names)
    return PrimitiveConstructorSpec(
        nargs="*" if separator == " " else 1,
        metavar=f"{_metavar(known, ',', also)}{separator.strip() or ' '}...",
        instance_from_str=lambda words: tuple(
            _checked(name.strip(), known, check, also) for name in separator.join(words).split(separator)
        ),
        is_instance=lambda value: isinstance(value, tuple) and (check is not None or set(value) <= set(known)),
        str_from_instance=lambda value: list(value) if separator == " " else [separator.join(value)],
    )


def _metavar(known: Collection[str], separator: str, also: str) -> str:
    return f"{{{separator.join([*known, *filter(None, [also])])}}}"


def _checked(name: str, known: Collection[str], check: Callable[[str], Any] | None, also: str) -> str:
    if check is not None and not name.isidentifier():
        check(name)
    elif name not in known:
        raise ValueError(f"'{name}' is unknown; choose from {', '.join([*known, *filter(None, [also])])}")
    return name


def parse(what: Callable, program: str, words: Sequence[str], description: str | None = None, **options: Any) -> Any:
    """Turn words into what a dataclass or a function's arguments ask for.

    Args:
        what: dataclass to make, or function to call with what was said.
        program: how the command is called, for help and messages.
        words: after it.
        description: what help says first; None for the docstring.
        options: of `tyro.cli`.

    Raises:
        SystemExit: help was asked for (0), or a word makes no sense (2) and one line on stderr has said so.
    """
    told = io.StringIO()
    for part in _parts(what):
        _teach(part)
    try:
        with contextlib.redirect_stderr(told):
            asked = tyro.cli(
                what,
                prog=program,
                args=list(words),
                description=_description(docstring(what) if description is None else description),
                config=(tyro.conf.DisallowNone,),
                **options,
            )
    except SystemExit as stop:
        if stop.code:
            print(f"contactsafe: {_one_line(told.getvalue())}; see {program} --help", file=sys.stderr)
        raise
    print(told.getvalue(), end="", file=sys.stderr)
    return asked


def call(function: Callable, program: str, words: Sequence[str]) -> None:
    """Call a function with the arguments that words name; its own messages are its own."""
    _teach(function)

    @functools.wraps(function)
    def later(*args: Any, **kwargs: Any) -> Callable:
        return functools.partial(function, *args, **kwargs)

    parse(later, program, words)()


def docstring(thing: Any) -> str:
    """Return the docstring of a function or class; from its source where `python -OO` has dropped it."""
    if sys.flags.optimize < 2 or (inspect.isfunction(thing) and thing.__doc__):
        return inspect.getdoc(thing) or ""
    try:
        body = ast.parse(textwrap.dedent(inspect.getsource(thing))).body[0]
    except (OSError, TypeError):  # there is no source
        return ""
    return ast.get_docstring(body) or "" if isinstance(body, ast.FunctionDef | ast.ClassDef) else ""


def _teach(thing: Any) -> None:
    """Have tyro find under -OO too what it says in help."""
    if sys.flags.optimize >= 2:
        thing.__doc__ = docstring(thing)


def _description(text: str) -> str:
    """Fit what a docstring says before its arguments to the terminal; lines that are indented stay as they are.

    Every line begins with a space, or tyro would join it to the one before it; it doubles empty ones.
    """
    width = max(40, shutil.get_terminal_size().columns) - 1
    paragraphs = re.split(r"\n+(?:Args|Attributes|Raises|Returns):\n", text)[0].split("\n\n")
    filled = [part if part.startswith(" ") else textwrap.fill(part, width) for part in paragraphs]
    return textwrap.indent("\n".join(filled), " ")


def _parts(what: Any) -> Iterator[Any]:
    """Yield the dataclasses that say what is asked for: a dataclass, its bases, and those that its fields are of."""
    for kind in getattr(what, "__mro__", ()):
        if dataclasses.is_dataclass(kind):
            yield kind
            for field in dataclasses.fields(kind):
                yield from _parts(field.type)


def _one_line(box: str) -> str:
    """Take title and frame off a message of tyro's, and what it says of help."""
    plain = re.sub(r"\x1b\[[\d;]*m", "", box)  # in a terminal it has colours
    inner = [line.strip("│ ") for line in plain.splitlines()[1:]]
    text = re.sub(r"\s+", " ", " ".join(line for line in inner if line.strip("╰╯─-")))
    text = text.partition("For full helptext")[0].strip()
    for found, said in _PLAINER.items():
        text = re.sub(found, said, text)
    return text.rstrip(".; ")
