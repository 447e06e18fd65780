"""The page on one's own robot prints what it says it prints."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from tests.docs import assert_prints

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "howto" / "own_robot.md").read_text(encoding="utf-8")
SNIPPET = re.compile(r"<!-- runnable -->\n```python\n(.*?)^```.*?^```text\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize(("code", "shown"), SNIPPET.findall(PAGE), ids=["loop", "environment"])
def test_snippet_prints_what_the_page_shows(code, shown):
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert_prints(done.stdout, shown)


def test_example_of_the_page_exists():
    assert all((ROOT / path).exists() for path in re.findall(r"examples/[\w.]+\.\w+", PAGE))
