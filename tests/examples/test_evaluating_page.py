"""The page on evaluating: every figure that is printed is explained."""

import re
import subprocess
import sys
from pathlib import Path

from contactsafe.tasks.wiping.figures import FIGURES

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "howto" / "evaluating.md").read_text(encoding="utf-8")


def test_snippet_prints_ink_and_force(ran):
    (printed,), _ = ran("howto/evaluating.md")
    assert re.fullmatch(r"[\d.]+ % of the ink left, [\d.]+ N at the most\n", printed)


def test_every_figure_is_explained():
    explained = set()
    for names in re.findall(r"^\| ((?:`\w+`(?:, )?)+) \|", PAGE, re.MULTILINE):
        first, *endings = re.findall(r"`(\w+)`", names)
        stem = first.rsplit("_", 2 if first.endswith("_n") else 1)[0]
        explained |= {first, *(stem + ending for ending in endings)}
    assert explained == {figure.name for figure in FIGURES} - {"episodes"}


def test_commands_have_the_options_that_are_named():
    code = "from contactsafe.cli import main; main(['evaluate', '--help'])"
    help_text = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False).stdout
    for option in re.findall(r"`(--[\w-]+)", PAGE):
        assert option in help_text
