"""Every example runs, and does what it says."""

import importlib.util
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("[0-9]*.py"))


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_runs_and_says_something(path, capsys):
    load(path).main()
    assert capsys.readouterr().out.strip()


def test_the_controller_alone_holds_the_tool_under_a_push():
    assert load(EXAMPLES[0]).main() < 0.01


def test_the_box_in_ones_own_scene_is_left_alone_by_the_safe_controller_only():
    lasting = load(EXAMPLES[3]).main()
    assert lasting["vices"] > 40
    assert lasting["safe"] < 10
