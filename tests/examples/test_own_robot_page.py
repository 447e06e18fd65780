"""The page on one's own robot names examples that are there."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "howto" / "own_robot.md").read_text(encoding="utf-8")


def test_example_of_the_page_exists():
    assert all((ROOT / path).exists() for path in re.findall(r"examples/[\w.]+\.\w+", PAGE))
