"""The page on collisions: its snippet runs and leaves what it says; its commands have the options it names."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "howto" / "collisions.md").read_text(encoding="utf-8")
SNIPPET = re.compile(r"<!-- runnable -->\n```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
METRICS = re.compile(r"^((?:`\w+`(?:, )?)+)$", re.MULTILINE)


def test_snippet_runs_and_every_column_is_explained(tmp_path):
    (code,) = SNIPPET.findall(PAGE)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "peak regressions against vices" in done.stdout
    assert "largest peak: seed" in done.stdout
    names = {path.name for path in (tmp_path / "my-collisions").iterdir()}
    assert names == {"report.html", "summary.json", "collisions.csv"}
    head = (tmp_path / "my-collisions" / "collisions.csv").read_text().splitlines()[0].split(",")
    explained = re.findall(r"`(\w+)`", " ".join(METRICS.findall(PAGE)))
    assert set(head[4:]) == set(explained)


def test_commands_exist():
    help_text = subprocess.run(
        [sys.executable, "-c", "from contactsafe.cli import main; main(['experiment', '--help'])"],
        capture_output=True,
        text=True,
        check=False,
    ).stdout
    lines = re.findall(r"^contactsafe experiment .*$", PAGE, re.MULTILINE)
    assert len(lines) == 3
    for option in re.findall(r"--\w+", " ".join(lines)):
        assert option in help_text
