"""Quoted results are renewed: whole blocks and parts, and nothing else of a page."""

import importlib.util
from pathlib import Path

import pytest

PATH = Path(__file__).parents[2] / "tools" / "quoted_results.py"
PAGE = """Before.

```sh
contactsafe bench
```
```text
  tick    4.1 us
  render  9.0 us
```
Between.

```sh
for k in 1 2; do
    contactsafe bench
done
```
```text
  tick 1.0 us
```
"""


@pytest.fixture
def tool(tmp_path, monkeypatch):
    spec = importlib.util.spec_from_file_location("quoted_results", PATH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "ROOT", tmp_path)
    return module


def test_a_part_is_renewed_from_its_first_line_on_and_all_else_stays(tool, tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    ran = []
    lines = ["all parts", "  tick   12.5 us", "  render  9.5 us", "  policy  1.0 us"]
    monkeypatch.setattr(tool, "printed", lambda command: ran.append(command) or lines)
    tool.renew(page, "")
    renewed = PAGE.replace("  tick    4.1 us\n  render  9.0 us\n", "  tick   12.5 us\n  render  9.5 us\n")
    assert page.read_text(encoding="utf-8") == renewed
    assert ran == ["contactsafe bench"]


def test_commands_that_were_not_asked_for_are_not_run(tool, tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    monkeypatch.setattr(tool, "printed", lambda command: pytest.fail(command))
    tool.renew(page, "evaluate")
    assert page.read_text(encoding="utf-8") == PAGE


def test_what_prints_other_lines_is_quoted_whole(tool):
    assert tool.excerpt(["one 1", "two 2"], ["three 3"]) == ["one 1", "two 2"]


def test_lines_left_out_of_a_quote_made_the_rest_of_it_other_lines(tool):
    printed = ["reported 54 %", "onset 15 ms", "before 0 %", "", "isolated 64 % ok"]
    assert tool.excerpt(printed, ["reported 1 %", "isolated 2 % ok"]) == ["reported 54 %", "isolated 64 % ok"]
    assert tool.excerpt(printed, ["reported 1 %", "isolated 2 % MISSED"]) == ["reported 54 %", "onset 15 ms"]
