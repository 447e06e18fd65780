"""Programs of the documentation, which is no package; its runnable pages, and what they say they print."""

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if "<!-- runnable" in path.read_text(encoding="utf-8"))
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
_BLOCK = re.compile(
    r"^<!-- runnable(?:: (?P<file>\S+))? -->\n+```(?P<language>\w+)\n(?P<code>.*?)^```\n"
    r"(?:\s*It prints:\s*```text\n(?P<shown>.*?)^```\n)?",
    re.MULTILINE | re.DOTALL,
)
_SHELL = 'set -e; python() { "%s" "$@"; }; contactsafe() { python -m contactsafe "$@"; }\n'
_A_MOMENT = "--max-minutes 0.02"


def run_page(page, folder):
    """Run a page's blocks marked `<!-- runnable -->`, top to bottom; return what each printed.

    A block marked `<!-- runnable: NAME -->` is written to that file. What stands after "It prints:" is compared. A
    training of minutes is cut to a moment.

    Args:
        page: path of the page.
        folder: empty, to run in; the examples are copied there, as in a clone.
    """
    shutil.copytree(DOCS.parent / "examples", folder / "examples")
    printed = []
    for block in _BLOCK.finditer(page.read_text(encoding="utf-8")):
        if block["file"]:
            (folder / block["file"]).write_text(block["code"], encoding="utf-8")
            continue
        command = [sys.executable, "-c", block["code"]]
        if block["language"] != "python":
            assert block["language"] == "sh", f"{page.name}: cannot run {block['language']}"
            code = re.sub(r"--max-minutes [\d.]+", _A_MOMENT, block["code"])
            command = ["bash", "-c", _SHELL % sys.executable + code]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{page.name}: {done.stdout}{done.stderr}"
        if block["shown"]:
            assert_prints(done.stdout, block["shown"])
        printed.append(done.stdout)
    return printed


def program(name):
    """Import docs/<name>.py."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def assert_prints(printed, shown):
    """Compare a text with the one a page shows: to the letter, and numbers to one unit of their last digit.

    Which way a number is rounded may hang on the last bits of a processor's arithmetic.
    """
    assert NUMBER.sub("#", printed) == NUMBER.sub("#", shown)
    for ours, theirs in zip(NUMBER.findall(printed), NUMBER.findall(shown), strict=True):
        unit = 10.0 ** -len(theirs.partition(".")[2])
        assert float(ours) == pytest.approx(float(theirs), rel=0, abs=1.001 * unit), f"{printed!r} for {shown!r}"
