"""Tables of the page on control, written from the code at every build, so that they cannot go stale."""

import re
from dataclasses import fields

from contactsafe import ControllerConfig, presets
from contactsafe.control.records import FAULTS


def parameters() -> str:
    """Every parameter with its meaning and its value in each preset; what differs from `paper` stands in bold."""
    configs = {name: presets.by_name(name) for name in ("vices", "paper", "safe")}
    meanings = _attributes(ControllerConfig.__doc__ or "")
    lines = ["| parameter | meaning | " + " | ".join(f"`{name}()`" for name in configs) + " |", "|---" * 5 + "|"]
    for field in fields(ControllerConfig):
        paper = getattr(configs["paper"], field.name)
        values = [getattr(config, field.name) for config in configs.values()]
        cells = [_text(value) if value == paper else f"**{_text(value)}**" for value in values]
        lines.append(f"| `{field.name}` | {meanings[field.name]} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def faults() -> str:
    """Every fault with its number in the records and its text."""
    return "\n".join(
        ["| `fault` | text in `Output.fault` |", "|---|---|", *(f"| {k} | {v} |" for k, v in FAULTS.items())]
    )


def fill(text: str) -> str:
    """Put the tables where the page asks for them."""
    return text.replace("<!-- table: parameters -->", parameters()).replace("<!-- table: faults -->", faults())


def _text(value) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return ", ".join(f"{number:g}" for number in value)
    return f"{value:g}".replace("inf", "∞")


def _attributes(docstring: str) -> dict[str, str]:
    """Read the Attributes section: name, then its meaning, perhaps over several lines."""
    section = docstring.split("Attributes:\n", 1)[1]
    found = re.findall(r"^ {8}(\w+): (.*(?:\n {12}.*)*)", section, re.MULTILINE)
    return {name: re.sub(r"\s+", " ", meaning).strip() for name, meaning in found}
