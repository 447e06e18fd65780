"""Operators that a model may use, each with a rule for what comes out of it and what it costs.

A value is a constant, or has a row for each of the batch and a size of its own beside; no operator mixes rows. Whatever
a rule does not know, it refuses: exported are few things.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

FLOAT = 1
"""ONNX's code of float32."""


class Value(NamedTuple):
    """What is known of a value beforehand: its shape, without the batch where it has rows, and a constant's numbers."""

    shape: tuple[int, ...]
    constant: np.ndarray | None = None


class NotAllowed(Exception):  # noqa: N818 -- an answer, caught next door, not an error
    """An operator is used as nothing here exports it."""


class Call:
    """An operator where it is used: its inputs, None for one left out, and its attributes."""

    def __init__(self, node: Any, inputs: list[Value | None]):
        self.inputs, self.outputs = inputs, len(node.output)
        self._attributes = {attribute.name: attribute for attribute in node.attribute}
        if len(self._attributes) != len(node.attribute):
            raise NotAllowed

    def rows(self, i: int) -> tuple[int, ...]:
        """Return the shape of input i, which has a row for each of the batch; without the batch."""
        value = self.inputs[i]
        if value is None or value.constant is not None:
            raise NotAllowed
        return value.shape

    def constant(self, i: int) -> np.ndarray:
        """Return input i, which is a constant."""
        value = self.inputs[i]
        if value is None or value.constant is None:
            raise NotAllowed
        return value.constant

    def number(self, name: str, default: int) -> int:
        """Return an attribute that is a whole number."""
        return self._attributes[name].i if name in self._attributes else default

    def numbers(self, name: str, default: list[int]) -> list[int]:
        """Return an attribute that is a list of whole numbers."""
        return list(self._attributes[name].ints) if name in self._attributes else default

    def axis(self, axis: int, rank: int) -> int:
        """Return the place of an axis in a shape without the batch; the batch itself is no axis to work along."""
        axis = axis + rank + 1 if axis < 0 else axis
        if not 1 <= axis <= rank:
            raise NotAllowed
        return axis - 1

    def text(self, name: str, default: bytes) -> bytes:
        """Return an attribute that is a text."""
        return self._attributes[name].s if name in self._attributes else default


Shapes = tuple[list[tuple[int, ...]], int]
"""Shapes of what comes out, without the batch, and how many multiplications that takes."""


def _same(call: Call) -> Shapes:
    return [call.rows(0)], math.prod(call.rows(0))


def _cast(call: Call) -> Shapes:
    if call.number("to", 0) != FLOAT:
        raise NotAllowed
    return _same(call)


def _clip(call: Call) -> Shapes:
    for i in range(1, len(call.inputs)):
        if call.inputs[i] is not None and call.constant(i).size != 1:
            raise NotAllowed
    return _same(call)


def _broadcast(call: Call) -> Shapes:
    """Spread constants over rows; rows meet rows of the same rank."""
    given = [value for value in call.inputs if value is not None]
    ranks = {len(value.shape) for value in given if value.constant is None}
    (rank,) = ranks  # one, and there is one
    shapes = []
    for value in given:
        shape = value.shape
        if value.constant is not None and len(shape) > rank:
            if len(shape) > rank + 1 or shape[0] != 1:
                raise NotAllowed
            shape = shape[1:]
        shapes.append(shape)
    shape = np.broadcast_shapes(*shapes)
    return [shape], math.prod(shape) * len(shapes)


def _concat(call: Call) -> Shapes:
    shapes = [call.rows(i) for i in range(len(call.inputs))]
    along = call.axis(call.number("axis", 0), len(shapes[0]))
    if len({(*shape[:along], *shape[along + 1 :], len(shape)) for shape in shapes}) != 1:
        raise NotAllowed
    first = shapes[0]
    return [(*first[:along], sum(shape[along] for shape in shapes), *first[along + 1 :])], 0


def _gemm(call: Call) -> Shapes:
    (k,) = call.rows(0)
    weights = call.constant(1)
    weights = weights.T if call.number("transB", 0) else weights
    biased = len(call.inputs) < 3 or call.inputs[2] is None or call.constant(2).shape in ((weights.shape[1],), (1,), ())
    if weights.ndim != 2 or weights.shape[0] != k or call.number("transA", 0) or not biased:
        raise NotAllowed
    return [(weights.shape[1],)], weights.size


def _matmul(call: Call) -> Shapes:
    (k,) = call.rows(0)
    weights = call.constant(1)
    if weights.ndim != 2 or weights.shape[0] != k:
        raise NotAllowed
    return [(weights.shape[1],)], weights.size


def _conv(call: Call) -> Shapes:
    channels, *size = call.rows(0)
    weights = call.constant(1)
    group, kernel = call.number("group", 1), list(weights.shape[2:])
    strides, dilations = call.numbers("strides", [1, 1]), call.numbers("dilations", [1, 1])
    pads = call.numbers("pads", [0, 0, 0, 0])
    plain = (
        len(size) == 2 and weights.ndim == 4 and len(strides) == 2 and len(pads) == 4 and dilations == [1, 1]
        and call.numbers("kernel_shape", kernel) == kernel and call.text("auto_pad", b"NOTSET") == b"NOTSET"
        and 1 <= group <= channels and weights.shape[1] * group == channels and weights.shape[0] % group == 0
        and min(strides) >= 1 and all(0 <= margin < edge for margin, edge in zip(pads, 2 * kernel, strict=True))
        and (len(call.inputs) < 3 or call.constant(2).shape == weights.shape[:1])
    )  # fmt: skip
    if not plain:
        raise NotAllowed
    out = [(size[k] + pads[k] + pads[k + 2] - kernel[k]) // strides[k] + 1 for k in (0, 1)]
    return [(weights.shape[0], *out)], weights.size * math.prod(out)


def _layer_norm(call: Call) -> Shapes:
    shape = call.rows(0)
    call.axis(call.number("axis", -1), len(shape))
    for i in range(1, len(call.inputs)):
        if np.broadcast_shapes(call.constant(i).shape, shape) != shape:
            raise NotAllowed
    return [shape], 4 * math.prod(shape)


def _unsqueeze(call: Call) -> Shapes:
    shape = list(call.rows(0))
    axes = call.constant(1).reshape(-1).tolist()
    for axis in sorted(call.axis(axis, len(shape) + len(axes)) for axis in axes):
        shape.insert(axis, 1)
    return [tuple(shape)], 0


def _squeeze(call: Call) -> Shapes:
    shape = call.rows(0)
    gone = {call.axis(axis, len(shape)) for axis in call.constant(1).reshape(-1).tolist()}
    if any(shape[k] != 1 for k in gone):
        raise NotAllowed
    return [tuple(size for k, size in enumerate(shape) if k not in gone)], 0


def _flatten(call: Call) -> Shapes:
    if call.number("axis", 1) != 1:
        raise NotAllowed
    return [(math.prod(call.rows(0)),)], 0


def _reshape(call: Call) -> Shapes:
    """Allow [-1, sizes] and [0, sizes]: the rows stay."""
    shape = call.rows(0)
    batch, *wanted = call.constant(1).reshape(-1).tolist()
    if batch not in (-1, 0) or (call.number("allowzero", 0) and batch == 0):
        raise NotAllowed
    if batch == 0 and wanted.count(-1) == 1:
        rest = -math.prod(wanted)
        wanted[wanted.index(-1)] = math.prod(shape) // max(rest, 1)
    if min(wanted, default=1) < 1 or math.prod(wanted) != math.prod(shape):
        raise NotAllowed
    return [tuple(wanted)], 0


def _split(call: Call) -> Shapes:
    shape = call.rows(0)
    along = call.axis(call.number("axis", 0), len(shape))
    if len(call.inputs) > 1:
        sizes = call.constant(1).reshape(-1).tolist()
    else:
        sizes = [shape[along] // call.outputs] * call.outputs
    if sum(sizes) != shape[along] or call.number("num_outputs", len(sizes)) != len(sizes):
        raise NotAllowed
    return [(*shape[:along], size, *shape[along + 1 :]) for size in sizes], 0


RULES: dict[str, Callable[[Call], Shapes]] = {
    **dict.fromkeys(("Abs", "Elu", "Erf", "Exp", "Identity", "LeakyRelu", "Neg", "Relu"), _same),
    **dict.fromkeys(("HardSigmoid", "HardSwish", "Selu", "Sigmoid", "Softplus", "Sqrt", "Tanh"), _same),
    **dict.fromkeys(("Add", "Div", "Greater", "Max", "Min", "Mul", "Pow", "Sub", "Where"), _broadcast),
    "Cast": _cast,
    "Clip": _clip,
    "Concat": _concat,
    "Conv": _conv,
    "Flatten": _flatten,
    "Gemm": _gemm,
    "LayerNormalization": _layer_norm,
    "MatMul": _matmul,
    "Reshape": _reshape,
    "Split": _split,
    "Squeeze": _squeeze,
    "Unsqueeze": _unsqueeze,
}  # fmt: skip
"""Operators that are allowed, each with the shape of what comes out and what it costs."""
