"""Worlds know fixtures, tips and obstacles; what a task makes of them is the task's."""

import re
from pathlib import Path

import pytest

import contactsafe.sim

WORDS = re.compile(r"\b(ink|boards?|pads?|wip(e|es|ed|ing)|whiteboards?|drawings?|pegs?|holes?)\b", re.IGNORECASE)
FILES = sorted(Path(contactsafe.sim.__file__).parent.glob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_no_word_of_a_task_in_this_room(path):
    assert [match.group() for match in WORDS.finditer(path.read_text(encoding="utf-8"))] == []
