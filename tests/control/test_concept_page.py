"""The page on control says every parameter, every fault and nothing that the code does not."""

import re
from dataclasses import fields

import pytest
from tests.docs import DOCS, program

from contactsafe import ControllerConfig
from contactsafe.control import estimate, laws, supervisor
from contactsafe.control.records import FAULTS

PAGE = (DOCS / "concepts" / "control.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def tables():
    return program("controller_tables")


def test_both_tables_stand_in_the_page(tables):
    filled = tables.fill(PAGE)
    assert tables.parameters() in filled
    assert tables.faults() in filled


def test_every_parameter_has_a_row_with_meaning_and_three_values(tables):
    rows = [line.split(" | ") for line in tables.parameters().splitlines()[2:]]
    assert [row[0].strip("| `") for row in rows] == [field.name for field in fields(ControllerConfig)]
    assert all(len(row) == 5 and all(cell.strip("| ") for cell in row) for row in rows)


def test_values_are_the_presets_and_bold_where_they_differ_from_the_paper(tables):
    table = tables.parameters()
    assert re.search(r"\| `contact_aware` \|.*\| \*\*no\*\* \| yes \| yes \|", table)
    assert re.search(r"\| `contact_torque_limit_comply_nm` \|.*\| ∞ \| ∞ \| \*\*2\*\* \|", table)
    assert re.search(r"\| `K_posture` \|.*\| 40, 40, 40, 40, 30, 20, 10 \| 40, 40", table)


def test_every_fault_has_a_row(tables):
    for number, text in FAULTS.items():
        assert f"| {number} | {text} |" in tables.faults()


def test_page_names_no_parameter_that_is_not_there():
    known = {field.name for field in fields(ControllerConfig)} | {"fault", "control_tick", "reset"}
    known |= {name for module in (laws, estimate, supervisor) for name in vars(module)}
    named = set(re.findall(r"`([a-z]+_[a-z_]+)`", PAGE))
    assert named <= known
