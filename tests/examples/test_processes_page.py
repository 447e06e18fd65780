"""The page on processes prints what it says it prints."""

import re
import subprocess
import sys
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs" / "howto" / "processes.md").read_text(encoding="utf-8")
SNIPPET = re.compile(r"<!-- runnable -->\n```python\n(.*?)^```.*?^```text\n(.*?)^```", re.MULTILINE | re.DOTALL)


def test_snippet_prints_what_the_page_shows(tmp_path):
    ((code, shown),) = SNIPPET.findall(PAGE)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == shown
