"""The page on loads prints what it says it prints."""

import re
import subprocess
import sys
from pathlib import Path

from tests.docs import assert_prints

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "howto" / "loads.md").read_text(encoding="utf-8")
SNIPPET = re.compile(r"<!-- runnable -->\n```python\n(.*?)^```.*?^```text\n(.*?)^```", re.MULTILINE | re.DOTALL)


def test_snippet_prints_what_the_page_shows():
    ((code, shown),) = SNIPPET.findall(PAGE)
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert_prints(done.stdout, shown)
