"""Rules of operators say what NumPy finds, for rows of any batch; they refuse what would mix rows."""

from types import SimpleNamespace

import numpy as np
import pytest

from contactsafe.policy.operators import RULES, Call, NotAllowed, Value


def attribute(name, value):
    kind = {int: "i", bytes: "s", list: "ints"}[type(value)]
    return SimpleNamespace(name=name, **{kind: value})


def rule(kind, *inputs, outputs=1, **attributes):
    """Return what a rule says of an operator: shapes without the batch, and multiplications."""
    node = SimpleNamespace(
        output=["out"] * outputs, attribute=[attribute(name, value) for name, value in attributes.items()]
    )
    return RULES[kind](Call(node, list(inputs)))


def rows(*shape):
    return Value(shape)


def constant(numbers):
    numbers = np.asarray(numbers)
    return Value(numbers.shape, numbers)


@pytest.mark.parametrize("batch", [1, 7])
@pytest.mark.parametrize("shapes", [((5,), (5,)), ((3, 4), (4,)), ((2, 3), (1, 3)), ((6,), ())])
def test_sums_of_rows_and_constants_have_the_shape_that_numpy_finds(batch, shapes):
    of_rows, of_constant = shapes
    ((shape,), cost) = rule("Add", rows(*of_rows), constant(np.ones(of_constant, np.float32)))
    found = np.ones((batch, *of_rows)) + np.ones(of_constant)
    assert (batch, *shape) == found.shape
    assert cost >= found[0].size


@pytest.mark.parametrize("transposed", [0, 1])
def test_a_layer_has_as_many_outputs_as_columns_and_costs_its_weights(transposed):
    weights = np.ones((3, 5) if transposed else (5, 3), np.float32)
    found = rule("Gemm", rows(5), constant(weights), constant(np.ones(3, np.float32)), transB=transposed)
    assert found == ([(3,)], 15)


@pytest.mark.parametrize(
    ("kind", "inputs", "attributes"),
    [
        ("Gemm", (rows(4), constant(np.ones((5, 3)))), {}),
        ("Gemm", (rows(5), constant(np.ones((5, 3)))), {"transA": 1}),
        ("Gemm", (rows(5), rows(5, 3)), {}),
        ("Concat", (rows(2, 3), rows(2, 4)), {"axis": 1}),
        ("Concat", (rows(2), rows(3)), {"axis": 0}),
        ("Add", (rows(5), constant(np.ones((2, 5)))), {}),
    ],
)
def test_what_does_not_fit_or_would_mix_rows_is_refused(kind, inputs, attributes):
    with pytest.raises(NotAllowed):
        rule(kind, *inputs, **attributes)


@pytest.mark.parametrize("axis", [1, -1])
def test_joined_rows_are_as_long_as_all_of_them(axis):
    assert rule("Concat", rows(2), rows(3), rows(4), axis=axis)[0] == [(9,)]


@pytest.mark.parametrize("kind", RULES)
def test_no_rule_takes_an_operator_without_inputs(kind):
    with pytest.raises((NotAllowed, ArithmeticError, LookupError, TypeError, ValueError)):
        rule(kind)


def test_an_attribute_that_stands_twice_is_refused():
    node = SimpleNamespace(output=["out"], attribute=[attribute("axis", 1), attribute("axis", 0)])
    with pytest.raises(NotAllowed):
        Call(node, [rows(2)])
