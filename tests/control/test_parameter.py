"""Declared once: a parameter's check and the record that compiled code reads come from its field."""

from dataclasses import dataclass, fields

import numpy as np
import pytest

from contactsafe.control.parameter import Stage, allowed, fill_record, from_text, parameter, record_fields
from contactsafe.core.errors import InvalidInputError


@dataclass(frozen=True)
class Example(Stage):
    """A stage that is not in the package."""

    gain: float = parameter(2.0, "1/s", "a gain", positive=True)
    part: float = parameter(0.5, "", "a fraction", fraction=True)
    bound: float = parameter(np.inf, "N", "a bound", infinite=True)
    on: bool = parameter(True, "", "a switch")
    span: tuple[float, float] = parameter((1.0, 2.0), "m", "a range")
    each: tuple[float, ...] = parameter((3.0, 4.0), "N m", "one a joint", per_joint=True)
    source: str = parameter("near", "", "a choice", choices=("far", "near"))


def test_record_holds_every_parameter_for_any_number_of_joints():
    record = np.zeros((), dtype=record_fields(Example, 3))
    fill_record(record, Example())
    assert [record[name].tolist() for name in record.dtype.names] == [
        2.0,
        0.5,
        np.inf,
        1,
        [1.0, 2.0],
        [3.0, 4.0, 4.0],
        1,
    ]


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"gain": 0.0}, "gain = 0.0 must be greater than 0"),
        ({"gain": np.inf}, "gain = inf is infinite; give finite numbers ≥ 0"),
        ({"part": 1.5}, "part = 1.5 is no fraction; give more than 0 and at most 1"),
        ({"bound": -1.0}, "bound = -1.0 has a negative number or NaN; give numbers ≥ 0"),
        ({"span": (2.0, 1.0)}, "span = (2.0, 1.0) is empty; give (lowest, highest)"),
        ({"source": "middle"}, "source = 'middle' is no choice; give one of far, near"),
        ({"source": 1}, "source = 1 is no choice; give one of far, near"),
        ({"each": 3.0}, "each = 3.0 has the wrong shape; give one number a joint"),
    ],
)
def test_bounds_are_those_declared(changed, text):
    with pytest.raises(InvalidInputError) as caught:
        Example(**changed)
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("gain", "> 0"), ("part", "> 0, ≤ 1"), ("bound", "≥ 0 or ∞"), ("on", "yes, no"),
        ("span", "≥ 0, lowest < highest"), ("each", "≥ 0, each"),
    ],
)  # fmt: skip
def test_bounds_in_words(name, words):
    assert allowed(Example.__dataclass_fields__[name]) == words


@pytest.mark.parametrize(
    "example", [Example(), Example(gain=0.25, on=False, span=(0.5, 3.0), each=(7.0,)), Example(each=(1.0, 2.0, 3.0))]
)
def test_text_says_every_value(example):
    for declared in fields(Example):
        value = getattr(example, declared.name)
        if isinstance(value, bool):
            text = "yes" if value else "no"
        else:
            text = "/".join(str(number) for number in np.atleast_1d(value))
        assert from_text(declared, text) == value


@pytest.mark.parametrize(
    ("name", "text", "error"),
    [
        ("on", "1", "on = '1' is a switch; give yes or no"),
        ("gain", "fast", "gain = 'fast' is not made of numbers; give numbers ≥ 0"),
        ("span", "1/", "span = '1/' is not made of numbers; give numbers ≥ 0"),
    ],
)
def test_text_that_says_no_value(name, text, error):
    with pytest.raises(InvalidInputError) as caught:
        from_text(Example.__dataclass_fields__[name], text)
    assert str(caught.value) == error
