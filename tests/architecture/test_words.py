"""Every room knows what stands below it: no word of a task where tasks are not, no name where reports are made."""

import ast
import re
from pathlib import Path

import pytest

import contactsafe
from contactsafe.experiments.registry import ENTRIES
from contactsafe.tasks import TASKS

SOURCE = Path(contactsafe.__file__).parent
KNOW_TASKS = ("tasks", "vision")
ROOMS = sorted(
    path.name for path in SOURCE.iterdir() if (path / "__init__.py").exists() and path.name not in KNOW_TASKS
)
WORDS = re.compile(r"\b(ink|board|pad|wiping|peg|hole)\b", re.IGNORECASE)
TEXT = {".py", ".js", ".css", ".html", ".json", ".xml", ".md", ".txt"}
BUNDLES = SOURCE / "policy" / "bundles"
"""What is shipped for each task, named after it."""


def files_of(folder):
    """Return the files of a room that are text, but for the policies that it ships."""
    return [path for path in sorted(folder.rglob("*")) if path.suffix in TEXT and BUNDLES not in path.parents]


@pytest.mark.parametrize("room", ROOMS)
def test_no_word_of_a_task_outside_tasks_and_vision(room):
    files = files_of(SOURCE / room)
    found = {str(path.relative_to(SOURCE)): WORDS.findall(path.read_text(encoding="utf-8")) for path in files}
    assert files
    assert {path: words for path, words in found.items() if words} == {}


def test_no_word_of_a_task_in_the_modules_beside_the_rooms():
    assert [path.name for path in SOURCE.glob("*.py") if WORDS.search(path.read_text(encoding="utf-8"))] == []


def test_reports_name_no_task():
    """What is shown of a task comes with its results."""
    names = re.compile(rf"\b({'|'.join(TASKS)})\b", re.IGNORECASE)
    for path in files_of(SOURCE / "report"):
        assert names.findall(path.read_text(encoding="utf-8")) == [], path.name


@pytest.mark.parametrize("path", sorted((SOURCE / "report").rglob("*.py")), ids=lambda path: path.name)
def test_reports_name_no_experiment(path):
    """Some of their names are words of English too: what counts is text that is one, or module that is asked for."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    texts = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    assert texts & set(ENTRIES) == set()
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert [module for module in modules if module and module.startswith("contactsafe.experiments")] == []
