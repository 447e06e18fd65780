"""The page on experiments of one's own: its experiment shows up wherever those of the package do."""

import importlib.util
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def run(ran):
    (printed,), folder = ran("howto/own_experiment.md")
    return printed, folder / "dropping"


def test_its_metric_is_in_the_terminals_table(run):
    printed, _ = run
    assert "Dropping: 5 cm down" in printed
    assert re.search(r"overshoot of the tool +mm .*always under 10 mm (ok|MISSED)", printed)


def test_its_metric_card_and_curve_are_on_the_page(run):
    page = (run[1] / "report.html").read_text(encoding="utf-8")
    assert '<section id="dropping">' in page
    assert 'data-figure="dropping/5 cm down/safe/overshoot_mm"' in page
    assert "Overshoot of a step of 5 cm" in page
    assert "height of the tool (mm)" in page


def test_its_metric_is_declared_in_the_summary_and_makes_a_row_of_the_readme(run):
    summary = json.loads((run[1] / "summary.json").read_text(encoding="utf-8"))
    found = summary["experiments"]["dropping"]
    assert found["metrics"]["overshoot_mm"] == {
        "label": "overshoot of the tool", "unit": "mm", "scale": 1.0, "middle": "median", "aim": "always under 10 mm",
    }  # fmt: skip
    assert set(found["spread"]["5 cm down"]) == {"vices", "safe"}
    spec = importlib.util.spec_from_file_location("readme_results", ROOT / "tools" / "readme_results.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    head, _, row = module.table(summary).splitlines()
    assert head == "| median [p5, p95] over seeds | unit | vices | safe |"
    assert re.fullmatch(r"\| Overshoot of a step of 5 cm \| mm \| [\d.]+ \[.*\] \| [\d.]+ \[.*\] \|", row)
