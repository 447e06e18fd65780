"""Every block of the documentation that is marked as runnable runs, and prints what the page shows."""

import re

import pytest
from tests.docs import DOCS, PAGES, run_page

NAMES = [path.relative_to(DOCS).as_posix() for path in PAGES]
MARKED = re.compile(r"<!-- runnable")


def _needs(name):
    """Return the marks of a page: those that train need torch, and time."""
    trains = "contactsafe train" in "".join(_runnable(name))
    return pytest.param(name, marks=[pytest.mark.train, pytest.mark.slow] if trains else [])


def _runnable(name):
    text = (DOCS / name).read_text(encoding="utf-8")
    return re.findall(r"<!-- runnable[^\n]*\n+```\w+\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("name", [_needs(name) for name in NAMES])
def test_page_runs_and_prints_what_it_shows(name, ran, request):
    if request.node.get_closest_marker("train"):
        pytest.importorskip("stable_baselines3")
    printed, _ = ran(name)
    assert printed


@pytest.mark.parametrize("name", NAMES)
def test_every_mark_is_followed_by_a_block(name):
    assert len(_runnable(name)) == len(MARKED.findall((DOCS / name).read_text(encoding="utf-8")))


def _page(folder, text):
    (folder / "run").mkdir()
    (folder / "page.md").write_text(text, encoding="utf-8")
    return folder / "page.md", folder / "run"


def test_a_block_that_fails_fails(tmp_path):
    with pytest.raises(AssertionError, match="ZeroDivisionError"):
        run_page(*_page(tmp_path, "<!-- runnable -->\n```python\n1 / 0\n```\n"))


def test_another_print_fails(tmp_path):
    block = "<!-- runnable -->\n```python\nprint(1.5)\n```\n\nIt prints:\n\n```text\n1.8\n```\n"
    with pytest.raises(AssertionError):
        run_page(*_page(tmp_path, block))


def test_a_file_of_the_page_is_there_for_the_next_block(tmp_path):
    file = "<!-- runnable: one.py -->\n```python\nX = 1\n```\n"
    block = "<!-- runnable -->\n```sh\npython -c 'import one; print(one.X)'\n```\n"
    assert run_page(*_page(tmp_path, file + block)) == ["1\n"]
