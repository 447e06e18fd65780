"""Names on a command line: those that are known, or what a check of one's own lets pass."""

from dataclasses import dataclass
from typing import Annotated

import pytest

from contactsafe.control import presets
from contactsafe.core.parse import one_of, parse, some_of


@dataclass(frozen=True)
class Choice:
    """What is compared.

    Attributes:
        one: a colour.
        controllers: presets to compare.
    """

    one: Annotated[str, one_of(("red", "blue"))] = "red"
    controllers: Annotated[tuple[str, ...], some_of(presets.PRESETS, check=presets.by_name)] = ("paper", "safe")


def test_names_and_what_a_check_lets_pass():
    assert parse(Choice, "choose", []) == Choice()
    words = ["--one", "blue", "--controllers", "vices,safe:tank_j=2"]
    assert parse(Choice, "choose", words) == Choice("blue", ("vices", "safe:tank_j=2"))


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--one", "green"], "'green' is unknown; choose from red, blue"),
        (["--controllers", "gentle"], "'gentle' is unknown; choose from vices, paper, safe"),
        (["--controllers", "safe:tank=2"], "parameter 'tank' is unknown; did you mean 'tank_s'?"),
        (["--controllers", "safe:dwell_s=-1"], "dwell_s = -1.0 has a negative number or NaN; give numbers ≥ 0"),
    ],
)
def test_what_does_not_pass_is_told_in_one_line(words, text, capsys):
    with pytest.raises(SystemExit) as caught:
        parse(Choice, "choose", words)
    assert caught.value.code != 0
    assert text in capsys.readouterr().err.replace("\n", " ")
