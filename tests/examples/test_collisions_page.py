"""The page on collisions: its snippet leaves what it says; its commands have the options it names."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "howto" / "collisions.md").read_text(encoding="utf-8")
METRICS = re.compile(r"^((?:`\w+`(?:, )?)+)$", re.MULTILINE)


def test_snippet_leaves_a_report_and_every_column_is_explained(ran):
    (printed,), folder = ran("howto/collisions.md")
    assert "peak regressions against vices" in printed
    assert "largest peak: seed" in printed
    names = {path.name for path in (folder / "my-collisions").iterdir()}
    assert names == {"report.html", "summary.json", "collisions.csv"}
    head = (folder / "my-collisions" / "collisions.csv").read_text().splitlines()[0].split(",")
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
