"""Programs of the documentation, which is no package, and what its pages say they print."""

import importlib.util
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


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
