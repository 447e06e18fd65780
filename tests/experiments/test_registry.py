"""What the registry holds: entries that count their trials, and declarations that fit together."""

import re
from pathlib import Path

import pytest

import contactsafe
from contactsafe.core.errors import InvalidInputError
from contactsafe.experiments import (
    adversarial,
    any_arm,
    clock,
    collisions,
    detection,
    disturbance,
    joint_safety,
    localisation,
    pushes,
    task_safety,
)
from contactsafe.experiments.config import ExperimentConfig
from contactsafe.experiments.registry import ENTRIES, PAPER, by_name
from contactsafe.tasks.wiping.scenes import Wiping

MODULES = (
    task_safety, joint_safety, disturbance, collisions, detection, pushes, localisation, adversarial, clock, any_arm,
)  # fmt: skip
ROOMS = Path(contactsafe.__file__).parent
CONFIG = ExperimentConfig(("vices", "safe"), trials=3, plants=("real", "clean"), minutes=1.0, models=("a", "b"))


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.NAME)
def test_metrics_are_declared_once_with_label_and_unit(module):
    names = [metric.name for metric in module.METRICS]
    assert len(set(names)) == len(names)
    units = {"n": "N", "nm": "N m", "ns": "N s", "mm": "mm", "ms": "ms", "s": "s", "j": "J", "mrad": "mrad"}
    for metric in module.METRICS:
        assert metric.label
        unit = units.get(metric.name.rpartition("_")[2])
        assert metric.unit in (unit, "%") or unit is None or metric.name.endswith("rad_s")
        assert (metric.scale == 100.0) == (metric.unit == "%")


@pytest.mark.parametrize("module", [joint_safety, disturbance], ids=lambda module: module.NAME)
def test_highlights_name_declared_metrics(module):
    assert {highlight.metric for highlight in module.HIGHLIGHTS} <= {metric.name for metric in module.METRICS}


def test_entries_go_by_their_own_names():
    assert [module.ENTRY.name for module in MODULES] == list(ENTRIES)
    assert set(PAPER) <= set(ENTRIES)
    for entry in ENTRIES.values():
        assert entry.about
        assert len(entry.about) < 64


@pytest.mark.parametrize(
    ("name", "count"),
    [("task-safety", 6), ("joint-safety", 12), ("disturbance", 36), ("collisions", 12), ("detection", 9),
     ("pushes", 12), ("localisation", 72), ("adversarial", 6), ("clock", 1056), ("robots", 8)],
)  # fmt: skip
def test_entries_count_the_trials_of_a_configuration(name, count):
    assert by_name(name).count(CONFIG) == count


def test_an_unknown_experiment_is_told_with_all_there_are():
    with pytest.raises(InvalidInputError) as caught:
        by_name("dancing")
    assert str(caught.value) == (
        "experiment 'dancing' is unknown; choose from task-safety, joint-safety, disturbance, collisions, detection, "
        "pushes, localisation, adversarial, clock, robots"
    )


def test_the_wiping_tasks_declarations_fit():
    names = {metric.name for metric in Wiping.metrics}
    assert {highlight.metric for highlight in Wiping.highlights} <= names
    assert {highlight.scenario for highlight in Wiping.highlights} == {Wiping.name}


@pytest.mark.parametrize("room", ["experiments", "report", "results"])
def test_no_task_is_known(room):
    word = re.compile(r"\b(ink|boards?|pad|wip(?:e|es|ing)|peg|hole)\b", re.IGNORECASE)
    files = [path for path in (ROOMS / room).rglob("*") if path.suffix in (".py", ".js", ".css", ".html")]
    assert len(files) > 3
    assert [f"{path.name}: {found[0]}" for path in files if (found := word.search(path.read_text("utf-8")))] == []


def test_reports_know_no_experiment():
    names = [*ENTRIES, *(metric.name for module in MODULES for metric in module.METRICS)]
    said = "".join(path.read_text("utf-8") for path in (ROOMS / "report").glob("*.py"))
    assert [name for name in names if re.search(rf"[\"']{re.escape(name)}[\"']", said)] == []
