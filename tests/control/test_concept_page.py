"""The page on control says every parameter, every fault and nothing that the code does not."""

import re
from pathlib import Path

import pytest
from tests.docs import DOCS, program

from contactsafe import control
from contactsafe.control import classification, laws, supervision
from contactsafe.control.codes import FAULTS
from contactsafe.control.config import STAGE_OF
from contactsafe.control.presets import SAFE

CONTROL = Path(control.__file__).parent
PAGE = (DOCS / "concepts" / "control.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def tables():
    return program("controller_tables")


def test_all_tables_stand_in_the_page(tables):
    filled = tables.fill(PAGE)
    assert tables.parameters() in filled
    assert tables.reasons() in filled
    assert tables.faults() in filled


def test_every_parameter_has_a_row_with_bounds_meaning_and_three_values(tables):
    rows = [line.strip("| ").split(" | ") for line in tables.parameters().splitlines() if line.startswith("| `")]
    assert [row[0].strip("`") for row in rows] == list(STAGE_OF)
    assert all(len(row) == 7 and all(row[2:]) for row in rows)


def test_every_value_of_safe_that_is_its_own_has_a_reason(tables):
    for name, (_, reason) in SAFE.items():
        assert re.search(rf"\| `{name}` \| .* \| {re.escape(reason)} \|", tables.reasons())


def test_values_are_the_presets_and_bold_where_they_differ_from_the_paper(tables):
    table = tables.parameters()
    assert re.search(r"\| `contact_aware` \|.*\| \*\*no\*\* \| yes \| yes \|", table)
    assert re.search(r"\| `contact_torque_limit_comply_nm` \|.*\| ∞ \| ∞ \| \*\*2\*\* \|", table)
    assert re.search(r"\| `K_posture` \|.*\| 40, 40, 40, 40, 30, 20, 10 \| 40, 40", table)


def test_every_fault_has_a_row(tables):
    for number, text in FAULTS.items():
        assert f"| {number} | {text} |" in tables.faults()


def test_page_names_no_parameter_that_is_not_there():
    known = set(STAGE_OF) | {"fault", "control_tick", "reset"} | {file.stem for file in CONTROL.glob("*.py")}
    known |= {name for module in (laws, classification, supervision) for name in vars(module)}
    named = set(re.findall(r"`([a-z]+_[a-z_]+)`", PAGE))
    assert named <= known
