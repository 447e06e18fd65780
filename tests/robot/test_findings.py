"""All that is wrong is told at once, and all that is odd beside it."""

import warnings

import pytest

from contactsafe.core.errors import InvalidInputError, ModelWarning
from contactsafe.robot.findings import Findings


def test_nothing_found_is_nothing_told():
    findings = Findings()
    findings.raise_problems()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        findings.warn("arm")


def test_one_problem_keeps_its_own_text():
    findings = Findings()
    with findings.noting():
        raise InvalidInputError("a is wrong; mend it")
    with pytest.raises(InvalidInputError) as caught:
        findings.raise_problems()
    assert str(caught.value) == "a is wrong; mend it"


def test_problems_are_numbered_and_told_once():
    findings = Findings()
    for text in ("a is wrong; mend it", "b is wrong; leave it out", "a is wrong; mend it"):
        findings.problem(text)
    with pytest.raises(InvalidInputError) as caught:
        findings.raise_problems()
    assert str(caught.value) == "2 things do not fit: (1) a is wrong; mend it; (2) b is wrong; leave it out"


def test_other_errors_are_not_caught():
    with pytest.raises(ZeroDivisionError), Findings().noting():
        raise ZeroDivisionError


def test_notes_are_one_warning():
    findings = Findings()
    findings.note("a is odd")
    findings.note("b is odd")
    with pytest.warns(ModelWarning) as said:
        findings.warn("six")
    assert [str(one.message) for one in said] == ["arm 'six': 2 things to know: (1) a is odd; (2) b is odd"]
