"""A parameter is declared once: default, unit, bounds and a sentence, in the field of the stage that reads it.

From the declaration come the check of a value, how it is written on a command line, the record that compiled code
reads, and the table in the documentation.
"""

from dataclasses import Field, dataclass, field, fields
from typing import Any

import numpy as np

from contactsafe.core.errors import InvalidInputError, shown

_f = np.float64
_i = np.int64


@dataclass(frozen=True)
class Parameter:
    """What is declared of a parameter beside its default.

    Attributes:
        unit: as written in the documentation; "" for a number without one.
        doc: one sentence.
        positive: whether 0 is refused.
        fraction: whether more than 1 is refused as well.
        infinite: whether inf is allowed, which stands for "no bound" or "at once".
        per_joint: whether there is one number a joint, of which the last repeats or is dropped for other arms.
        choices: words that it is one of, for what is no number; records have its place among them.
    """

    unit: str
    doc: str
    positive: bool = False
    fraction: bool = False
    infinite: bool = False
    per_joint: bool = False
    choices: tuple[str, ...] = ()


def parameter(default: Any, unit: str, doc: str, **bounds: Any) -> Any:
    """Declare a field of a `Stage`; see `Parameter`. Numbers are never negative."""
    return field(default=default, metadata={"parameter": Parameter(unit, doc, **bounds)})


def declaration(declared: Field) -> Parameter:
    """Return what a field of a `Stage` was declared with."""
    return declared.metadata["parameter"]


@dataclass(frozen=True)
class Stage:
    """Parameters of one stage of the pipeline, checked when made.

    Raises:
        InvalidInputError: a value is not a number, negative, or outside its bounds.
    """

    def __post_init__(self) -> None:
        """Refuse what no controller can mean."""
        for declared in fields(self):
            if declaration(declared).choices:
                _check_choice(declared, getattr(self, declared.name))
        numbers = [declared for declared in fields(self) if not declaration(declared).choices]
        for declared in numbers:
            _check_numbers(declared, getattr(self, declared.name))
        for declared in numbers:
            _check_bounds(declared, getattr(self, declared.name))


def _check_choice(declared: Field, value: Any) -> None:
    choices = declaration(declared).choices
    if not isinstance(value, str) or value not in choices:
        raise InvalidInputError(f"{declared.name} = {shown(value)} is no choice; give one of {', '.join(choices)}")


def _check_numbers(declared: Field, value: Any) -> None:
    """Check that a value is made of numbers from 0 on, of its default's shape."""
    name, known = declared.name, declaration(declared)
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name} = {value!r} is not made of numbers; give numbers ≥ 0") from None
    if np.isnan(numbers).any() or (numbers < 0).any():
        raise InvalidInputError(f"{name} = {value} has a negative number or NaN; give numbers ≥ 0")
    if not known.infinite and np.isinf(numbers).any():
        raise InvalidInputError(f"{name} = {value} is infinite; give finite numbers ≥ 0")
    if known.per_joint:
        fits, wanted = numbers.ndim == 1 and numbers.size > 0, "one number a joint"
    else:
        shape = _shape(declared)
        fits, wanted = numbers.shape == shape, "(lowest, highest)" if shape else "one number"
    if not fits:
        raise InvalidInputError(f"{name} = {value} has the wrong shape; give {wanted}")


def allowed(declared: Field) -> str:
    """Return in words which values a parameter may have, as the documentation lists them."""
    known = declaration(declared)
    if known.choices:
        return ", ".join(known.choices)
    if isinstance(declared.default, bool):
        return "yes, no"
    if known.fraction:
        return "> 0, ≤ 1"
    numbers = ("> 0" if known.positive else "≥ 0") + (" or ∞" if known.infinite else "")
    if known.per_joint:
        return f"{numbers}, each"
    return f"{numbers}, lowest < highest" if _shape(declared) else numbers


def from_text(declared: Field, text: str) -> Any:
    """Return the value of a parameter as written on a command line: a choice, yes or no, a number, numbers with /.

    Raises:
        InvalidInputError: it is none of these.
    """
    if declaration(declared).choices:
        _check_choice(declared, text)
        return text
    if isinstance(declared.default, bool):
        if text not in ("yes", "no"):
            raise InvalidInputError(f"{declared.name} = {text!r} is a switch; give yes or no")
        return text == "yes"
    try:
        numbers = tuple(float(word) for word in text.split("/"))
    except ValueError:
        raise InvalidInputError(f"{declared.name} = {text!r} is not made of numbers; give numbers ≥ 0") from None
    return numbers if len(numbers) > 1 or declaration(declared).per_joint else numbers[0]


def _shape(declared: Field) -> tuple[int, ...]:
    default: Any = declared.default
    return np.shape(default)


def _check_bounds(declared: Field, value: Any) -> None:
    name, known = declared.name, declaration(declared)
    if known.fraction and not 0 < value <= 1:
        raise InvalidInputError(f"{name} = {value} is no fraction; give more than 0 and at most 1")
    if known.positive and value <= 0:
        raise InvalidInputError(f"{name} = {value} must be greater than 0")
    if np.shape(value) == (2,) and not known.per_joint and not value[0] < value[1]:
        raise InvalidInputError(f"{name} = ({value[0]}, {value[1]}) is empty; give (lowest, highest)")


def record_fields(stage: type[Stage], n: int) -> list[tuple]:
    """Return the fields of a record that holds the parameters of a stage for an arm of n joints."""
    return [_record_field(declared, n) for declared in fields(stage)]


def _record_field(declared: Field, n: int) -> tuple:
    if isinstance(declared.default, bool) or declaration(declared).choices:
        return declared.name, _i
    if declaration(declared).per_joint:
        return declared.name, _f, (n,)
    return declared.name, _f, _shape(declared)


def fill_record(record: Any, stage: Stage) -> None:
    """Write the parameters of a stage into a record of `record_fields`."""
    for declared in fields(stage):
        value = getattr(stage, declared.name)
        if declaration(declared).choices:
            value = declaration(declared).choices.index(value)
        if declaration(declared).per_joint:
            value = [value[min(i, len(value) - 1)] for i in range(len(record[declared.name]))]
        record[declared.name] = value
