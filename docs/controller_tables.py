"""Tables of the page on control, written from the code at every build, so that they cannot go stale."""

from collections.abc import Iterator
from dataclasses import Field, fields

from contactsafe import presets
from contactsafe.control.codes import FAULTS
from contactsafe.control.config import STAGES
from contactsafe.control.parameter import allowed, declaration

NAMES = ("vices", "paper", "safe")


def parameters() -> str:
    """Every parameter by stage: unit, bounds, meaning and value in each preset; what differs from `paper` in bold."""
    header = "| parameter | unit | allowed | meaning | " + " | ".join(f"`{name}()`" for name in NAMES) + " |"
    return "\n".join([header, "|---" * 7 + "|", *_rows()])


def _rows() -> Iterator[str]:
    for stage, kind in STAGES.items():
        yield f"| **{stage}** | | | {(kind.__doc__ or '').split(chr(10))[0].rstrip('.')} | | | |"
        for field in fields(kind):
            known = declaration(field)
            yield (
                " | ".join([f"| `{field.name}`", known.unit, allowed(field), known.doc, *_values(stage, field)]) + " |"
            )


def _values(stage: str, field: Field) -> Iterator[str]:
    paper = getattr(getattr(presets.paper(), stage), field.name)
    for name in NAMES:
        value = getattr(getattr(presets.by_name(name), stage), field.name)
        yield _text(value) if value == paper else f"**{_text(value)}**"


def reasons() -> str:
    """Why each value of `safe()` is not the one of `paper()`."""
    rows = (f"| `{name}` | {_text(value)} | {reason} |" for name, (value, reason) in presets.SAFE.items())
    return "\n".join(["| parameter | `safe()` | because |", "|---|---|---|", *rows])


def faults() -> str:
    """Every fault with its number in the records and its text."""
    return "\n".join(
        ["| `fault` | text in `Output.fault` |", "|---|---|", *(f"| {k} | {v} |" for k, v in FAULTS.items())]
    )


def fill(text: str) -> str:
    """Put the tables where the page asks for them."""
    for name, table in (("parameters", parameters), ("reasons", reasons), ("faults", faults)):
        text = text.replace(f"<!-- table: {name} -->", table())
    return text


def _text(value) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        return ", ".join(f"{number:g}" for number in value)
    return f"{value:g}".replace("inf", "∞")
