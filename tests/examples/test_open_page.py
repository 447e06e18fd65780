"""The page on what the paper leaves open: every finding has a function, and what the page quotes is what it prints."""

import re

import pytest
from benchmarks.findings.__main__ import FINDINGS, main
from tests.docs import DOCS, assert_prints

from contactsafe.control.config import STAGE_OF
from contactsafe.experiments.registry import ENTRIES

PAGE = (DOCS / "concepts" / "open.md").read_text(encoding="utf-8")
QUOTED = dict(
    re.findall(r"^python -m benchmarks\.findings (\d+)\n```\n```text\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
)
TRAINED = {"9", "20", "21"}  # trainings take too long to be repeated
ALIKE_EVERYWHERE = {"2", "10"}  # no motion that another processor would change


def test_every_finding_of_the_page_has_a_function_and_a_figure():
    claimed = set(re.findall(r"^\*\*(\d+)\.\*\*", PAGE, re.MULTILINE))
    assert claimed - TRAINED == set(QUOTED) == {str(number) for number in FINDINGS}
    assert claimed >= TRAINED
    assert all(text.strip() for text in QUOTED.values())


def test_the_table_lists_them_all():
    assert set(re.findall(r"^\| \[(\d+)\]\(#", PAGE, re.MULTILINE)) == set(QUOTED) | TRAINED


@pytest.mark.parametrize("number", sorted(QUOTED, key=int))
def test_every_finding_runs_and_prints_what_the_page_quotes_but_for_its_figures(number, capsys):
    assert main([number]) == 0
    printed = capsys.readouterr().out
    assert without_figures(printed) == without_figures(QUOTED[number])
    if number in ALIKE_EVERYWHERE:
        assert_prints(printed, QUOTED[number])


def without_figures(text):
    """Return what is printed with its figures left out; how wide they are moves the spaces."""
    return re.sub(r"[-+\d.e]+", "#", re.sub(r"\s+", "", text))


def test_an_unknown_finding_is_refused(capsys):
    assert main(["9"]) == 2
    assert "give numbers out of 1, 2, " in capsys.readouterr().err


def test_experiments_it_sends_to_are_there():
    named = set(re.findall(r"`contactsafe experiment ([a-z-]+)", PAGE))
    assert len(named) > 2
    assert named <= set(ENTRIES)


def test_page_names_no_parameter_that_is_not_there():
    named = set(re.findall(r"`([a-z]+_[a-z_0-9]+)`", PAGE))
    assert named <= set(STAGE_OF)
