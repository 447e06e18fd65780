"""What an ONNX file may hold, read and checked before ONNX Runtime sees any of it.

A model is taken if what it costs can be told from the file. An operator is allowed if RULES says what shape comes out
of it; there are no loops, branches, functions or other files. A value is a constant, or it has a row for each of the
batch and a size of its own beside; no operator mixes rows. So memory and time are at most the stated ones times the
rows asked for, whatever the numbers are, and nothing has to be tried out to know.

ONNX Runtime gets the model written anew from what was read: nothing that was not looked at.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError

from contactsafe.errors import BundleError, shown

OPSETS = (13, 23)
"""Versions of ONNX's own operators that are read; exported is 18."""

MAX_NODES = 256
MAX_RANK = 6
MAX_ROW_NUMBERS = 16_000_000
"""Most numbers computed for one row of the batch, over all operators."""

MAX_ROW_PRODUCTS = 1_000_000_000
"""Most multiplications for one row of the batch: about a second's work."""

_FLOAT, _UINT8, _INT64 = 1, 2, 7
KINDS = {_FLOAT: "float", _UINT8: "uint8", _INT64: "int64"}
"""Types of numbers by ONNX's code."""

_SCHEMA = {
    "Model": "ir_version 1 int64, producer_name 2 bytes, producer_version 3 bytes, domain 4 bytes, "
    "model_version 5 int64, doc_string 6 bytes, graph 7 Graph, opset_import 8 Opset*",
    "Opset": "domain 1 bytes, version 2 int64",
    "Graph": "node 1 Node*, name 2 bytes, initializer 5 Tensor*, doc_string 10 bytes, input 11 Port*, "
    "output 12 Port*, value_info 13 Port*",
    "Node": "input 1 string*, output 2 string*, name 3 bytes, op_type 4 string, attribute 5 Attribute*, "
    "doc_string 6 bytes, domain 7 string",
    "Attribute": "name 1 string, f 2 float, i 3 int64, s 4 bytes, floats 7 float*, ints 8 int64*, doc_string 13 bytes, "
    "type 20 int32",
    "Tensor": "dims 1 int64*, data_type 2 int32, float_data 4 float*, int64_data 7 int64*, name 8 string, "
    "raw_data 9 bytes, doc_string 12 bytes, external_data 13 bytes*, data_location 14 int32",
    "Port": "name 1 string, type 2 Type, doc_string 3 bytes, notes 4 bytes*",
    "Type": "tensor_type 1 TensorType",
    "TensorType": "elem_type 1 int32, shape 2 Shape",
    "Shape": "dim 1 Dim*",
    "Dim": "dim_value 1 int64, dim_param 2 string",
}
"""The part of ONNX's format that is read: fields with number and type, * for lists; the rest is refused."""


class Graph(NamedTuple):
    """A checked model.

    Attributes:
        model: its bytes, for ONNX Runtime.
        inputs, outputs: by name the type, as ONNX Runtime writes it, and the shape; a free size is None.
    """

    model: bytes
    inputs: dict[str, tuple[str, list]]
    outputs: dict[str, tuple[str, list]]


class _Value(NamedTuple):
    """What is known of a value beforehand: its shape, without the batch where it has rows, and a constant's numbers."""

    shape: tuple[int, ...]
    constant: np.ndarray | None = None


class _ModelError(Exception):
    """What is wrong with a model, in words that follow its name."""

    def __init__(self, what: str = "", remedy: str = "export it anew"):
        super().__init__(what)
        self.remedy = remedy


def read_graph(data: bytes, name: str) -> Graph:
    """Read a model and make sure that it can be run at a known cost.

    Args:
        data: the file's bytes.
        name: what to call it in errors.

    Returns:
        The Graph.

    Raises:
        BundleError: the bytes are no ONNX model, or one with anything beyond what RULES knows.
    """
    try:
        return _read(data)
    except _ModelError as refused:
        raise BundleError(f"{name} {refused}; {refused.remedy}") from None
    except UnicodeDecodeError:
        raise BundleError(f"{name} has names that are no text; export it anew") from None


def check_ports(graph: Graph, name: str, inputs: dict, outputs: dict) -> None:
    """Refuse a model with other inputs and outputs than wanted.

    Args:
        graph: the model.
        name: what to call it in errors.
        inputs, outputs: by name the kind of number, such as "float", and the shape without the batch, a list.

    Raises:
        BundleError: one is absent, of another type or shape, of a fixed batch, or there is another.
    """
    for side, wanted, have in (("input", inputs, graph.inputs), ("output", outputs, graph.outputs)):
        for port, (kind, tail) in wanted.items():
            if port not in have or have[port][0] != f"tensor({kind})" or have[port][1][1:] != tail:
                raise BundleError(
                    f"{name}: {side} {port} is {shown(have[port]) if port in have else 'absent'}, not tensor({kind}) "
                    f"of shape (N, {', '.join(map(str, tail))}); export the bundle anew"
                )
            if have[port][1][0] is not None:
                raise BundleError(f"{name}: {side} {port} has a fixed batch size; export it with a free one")
        if len(have) != len(wanted):
            raise BundleError(
                f"{name}: {side}s are {shown(sorted(have))}, not {sorted(wanted)}; export the bundle anew"
            )


def _read(data: bytes) -> Graph:
    model = _messages()["Model"]()
    try:
        model.ParseFromString(data)
    except DecodeError:
        raise _ModelError("is not a model ONNX Runtime takes (it cannot be read as ONNX)") from None
    size = model.ByteSize()
    model.DiscardUnknownFields()
    graph = model.graph
    _check_opsets(model)
    values = {tensor.name: _constant(tensor) for tensor in graph.initializer}
    inputs = {port.name: _port(port) for port in graph.input}
    for name, (_, shape) in inputs.items():
        if name in values or not shape or None in shape[1:]:
            raise _ModelError(f"has an input {shown(name)} of shape {shown(shape)}")
        values[name] = _Value(tuple(shape[1:]))
    _check_nodes(graph.node, values)
    if model.ByteSize() != size:
        raise _ModelError("holds more than a graph of operators (functions, subgraphs or notes)")
    outputs = {port.name: _port(port) for port in graph.output}
    for name, (_, shape) in outputs.items():
        value = values.get(name)
        if value is None or value.constant is not None or not shape or value.shape != tuple(shape[1:]):
            raise _ModelError(f"has an output {shown(name)} of shape {shown(shape)} that it does not compute")
    given = len(graph.input) + len(graph.initializer) + sum(len(node.output) for node in graph.node)
    if len(values) != given or len(outputs) != len(graph.output) or "" in values:
        raise _ModelError("has values without a name of their own")
    del graph.value_info[:]
    for port in (*graph.input, *graph.output):
        del port.notes[:]
    return Graph(model.SerializeToString(), inputs, outputs)


@functools.cache
def _messages() -> dict[str, Any]:
    """Make protobuf's classes for _SCHEMA."""
    file = descriptor_pb2.FileDescriptorProto(name="contactsafe_onnx.proto", package="contactsafe_onnx")
    kinds = {kind[5:].lower(): value for kind, value in descriptor_pb2.FieldDescriptorProto.Type.items()}
    for message, fields in _SCHEMA.items():
        described = file.message_type.add(name=message)
        for field in fields.split(", "):
            name, number, kind = field.split()
            many, kind = kind.endswith("*"), kind.rstrip("*")
            added = described.field.add(name=name, number=int(number), label=3 if many else 1)
            if kind in _SCHEMA:
                added.type, added.type_name = kinds["message"], f".contactsafe_onnx.{kind}"
            else:
                added.type = kinds[kind]
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return {
        name: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"contactsafe_onnx.{name}"))
        for name in _SCHEMA
    }


def _check_opsets(model: Any) -> None:
    found = [(opset.domain.decode(errors="replace"), opset.version) for opset in model.opset_import]
    if len(found) != 1 or found[0][0] != "" or not OPSETS[0] <= found[0][1] <= OPSETS[1]:
        raise _ModelError(
            f"is not a model ONNX Runtime takes (it needs operators of {shown(found)}; allowed are ONNX's own of "
            f"version {OPSETS[0]} to {OPSETS[1]})"
        )


def _constant(tensor: Any) -> _Value:
    """Read the numbers of a tensor that stands in the file."""
    name = shown(tensor.name)
    if tensor.external_data or tensor.data_location:
        raise _ModelError("keeps weights in another file", "export it with the weights inside")
    shape = tuple(tensor.dims)
    if tensor.data_type not in (_FLOAT, _INT64) or len(shape) > MAX_RANK or any(size < 1 for size in shape):
        raise _ModelError(f"has weights {name} of type {tensor.data_type} and shape {shown(shape)}")
    kind = np.dtype("<f4" if tensor.data_type == _FLOAT else "<i8")
    listed = tensor.float_data if tensor.data_type == _FLOAT else tensor.int64_data
    given = [bool(tensor.raw_data), bool(tensor.float_data), bool(tensor.int64_data)]
    length = len(tensor.raw_data) / kind.itemsize if tensor.raw_data else len(listed)
    if sum(given) != 1 or length != math.prod(shape):
        raise _ModelError(f"has weights {name} of shape {shown(shape)} without as many numbers")
    numbers = np.frombuffer(tensor.raw_data, kind) if tensor.raw_data else np.array(listed, kind)
    if not np.isfinite(numbers).all():
        raise _ModelError(f"has weights {name} that are not finite")
    return _Value(shape, numbers.reshape(shape))


def _port(port: Any) -> tuple[str, list]:
    tensor = port.type.tensor_type
    shape = [dim.dim_value if dim.HasField("dim_value") else None for dim in tensor.shape.dim]
    if len(shape) > MAX_RANK + 1 or any(size is not None and not 1 <= size <= MAX_ROW_NUMBERS for size in shape):
        raise _ModelError(f"has a port {shown(port.name)} of shape {shown(shape)}")
    return f"tensor({KINDS.get(tensor.elem_type, tensor.elem_type)})", shape


def _check_nodes(nodes: Any, values: dict[str, _Value]) -> None:
    """Follow shapes through the operators, in their order, and add up what they cost; values are added to `values`."""
    if len(nodes) > MAX_NODES:
        raise _ModelError(f"has {len(nodes)} operators, at most {MAX_NODES} are allowed")
    numbers = products = 0
    for node in nodes:
        rule = RULES.get(node.op_type) if node.domain == "" else None
        if rule is None:
            operator = f"{node.domain}.{node.op_type}" if node.domain else node.op_type
            raise _ModelError(
                f"is not a model ONNX Runtime takes (operator {shown(operator)} is not one of {', '.join(RULES)})"
            )
        unknown = [name for name in node.input if name and name not in values]
        if unknown:
            raise _ModelError(f"uses {shown(unknown[0])} before it is computed")
        try:
            shapes, cost = rule(_Call(node, [values[name] if name else None for name in node.input]))
        except (_ModelError, IndexError, TypeError, ValueError, OverflowError):
            raise _ModelError(f"has an operator {node.op_type} of a kind that nothing here exports") from None
        if len(shapes) != len(node.output) or any(
            len(shape) > MAX_RANK or min(shape, default=1) < 1 for shape in shapes
        ):
            raise _ModelError(f"has an operator {node.op_type} with {len(node.output)} outputs {shown(shapes)}")
        numbers += sum(math.prod(shape) for shape in shapes)
        products += cost
        if numbers > MAX_ROW_NUMBERS or products > MAX_ROW_PRODUCTS:
            raise _ModelError(
                f"computes more than {MAX_ROW_NUMBERS} numbers or {MAX_ROW_PRODUCTS} products for one observation"
            )
        values.update(zip(node.output, map(_Value, shapes), strict=True))


class _Call:
    """An operator where it is used: its inputs, None for one left out, and its attributes."""

    def __init__(self, node: Any, inputs: list[_Value | None]):
        self.inputs, self.outputs = inputs, len(node.output)
        self._attributes = {attribute.name: attribute for attribute in node.attribute}
        if len(self._attributes) != len(node.attribute):
            raise _ModelError

    def rows(self, i: int) -> tuple[int, ...]:
        """Give the shape of input i, which has a row for each of the batch; without the batch."""
        value = self.inputs[i]
        if value is None or value.constant is not None:
            raise _ModelError
        return value.shape

    def constant(self, i: int) -> np.ndarray:
        """Give input i, which is a constant."""
        value = self.inputs[i]
        if value is None or value.constant is None:
            raise _ModelError
        return value.constant

    def number(self, name: str, default: int) -> int:
        """Give an attribute that is a whole number."""
        return self._attributes[name].i if name in self._attributes else default

    def numbers(self, name: str, default: list[int]) -> list[int]:
        """Give an attribute that is a list of whole numbers."""
        return list(self._attributes[name].ints) if name in self._attributes else default

    def axis(self, axis: int, rank: int) -> int:
        """Give the place of an axis in a shape without the batch; the batch itself is no axis to work along."""
        axis = axis + rank + 1 if axis < 0 else axis
        if not 1 <= axis <= rank:
            raise _ModelError
        return axis - 1

    def text(self, name: str, default: bytes) -> bytes:
        """Give an attribute that is a text."""
        return self._attributes[name].s if name in self._attributes else default


Shapes = tuple[list[tuple[int, ...]], int]
"""Shapes of what comes out, without the batch, and how many multiplications that takes."""


def _same(call: _Call) -> Shapes:
    return [call.rows(0)], math.prod(call.rows(0))


def _cast(call: _Call) -> Shapes:
    if call.number("to", 0) != _FLOAT:
        raise _ModelError
    return _same(call)


def _clip(call: _Call) -> Shapes:
    for i in range(1, len(call.inputs)):
        if call.inputs[i] is not None and call.constant(i).size != 1:
            raise _ModelError
    return _same(call)


def _broadcast(call: _Call) -> Shapes:
    """Spread constants over rows; rows meet rows of the same rank."""
    given = [value for value in call.inputs if value is not None]
    ranks = {len(value.shape) for value in given if value.constant is None}
    (rank,) = ranks  # one, and there is one
    shapes = []
    for value in given:
        shape = value.shape
        if value.constant is not None and len(shape) > rank:
            if len(shape) > rank + 1 or shape[0] != 1:
                raise _ModelError
            shape = shape[1:]
        shapes.append(shape)
    shape = np.broadcast_shapes(*shapes)
    return [shape], math.prod(shape) * len(shapes)


def _concat(call: _Call) -> Shapes:
    shapes = [call.rows(i) for i in range(len(call.inputs))]
    along = call.axis(call.number("axis", 0), len(shapes[0]))
    if len({(*shape[:along], *shape[along + 1 :], len(shape)) for shape in shapes}) != 1:
        raise _ModelError
    first = shapes[0]
    return [(*first[:along], sum(shape[along] for shape in shapes), *first[along + 1 :])], 0


def _gemm(call: _Call) -> Shapes:
    (k,) = call.rows(0)
    weights = call.constant(1)
    weights = weights.T if call.number("transB", 0) else weights
    biased = len(call.inputs) < 3 or call.inputs[2] is None or call.constant(2).shape in ((weights.shape[1],), (1,), ())
    if weights.ndim != 2 or weights.shape[0] != k or call.number("transA", 0) or not biased:
        raise _ModelError
    return [(weights.shape[1],)], weights.size


def _matmul(call: _Call) -> Shapes:
    (k,) = call.rows(0)
    weights = call.constant(1)
    if weights.ndim != 2 or weights.shape[0] != k:
        raise _ModelError
    return [(weights.shape[1],)], weights.size


def _conv(call: _Call) -> Shapes:
    channels, *size = call.rows(0)
    weights = call.constant(1)
    group, kernel = call.number("group", 1), list(weights.shape[2:])
    strides, dilations = call.numbers("strides", [1, 1]), call.numbers("dilations", [1, 1])
    pads = call.numbers("pads", [0, 0, 0, 0])
    plain = (
        len(size) == 2 and weights.ndim == 4 and len(strides) == 2 and len(pads) == 4 and dilations == [1, 1]
        and call.numbers("kernel_shape", kernel) == kernel and call.text("auto_pad", b"NOTSET") == b"NOTSET"
        and 1 <= group <= channels and weights.shape[1] * group == channels and weights.shape[0] % group == 0
        and min(strides) >= 1 and all(0 <= pad < edge for pad, edge in zip(pads, 2 * kernel, strict=True))
        and (len(call.inputs) < 3 or call.constant(2).shape == weights.shape[:1])
    )  # fmt: skip
    if not plain:
        raise _ModelError
    out = [(size[k] + pads[k] + pads[k + 2] - kernel[k]) // strides[k] + 1 for k in (0, 1)]
    return [(weights.shape[0], *out)], weights.size * math.prod(out)


def _layer_norm(call: _Call) -> Shapes:
    shape = call.rows(0)
    call.axis(call.number("axis", -1), len(shape))
    for i in range(1, len(call.inputs)):
        if np.broadcast_shapes(call.constant(i).shape, shape) != shape:
            raise _ModelError
    return [shape], 4 * math.prod(shape)


def _unsqueeze(call: _Call) -> Shapes:
    shape = list(call.rows(0))
    axes = call.constant(1).reshape(-1).tolist()
    for axis in sorted(call.axis(axis, len(shape) + len(axes)) for axis in axes):
        shape.insert(axis, 1)
    return [tuple(shape)], 0


def _squeeze(call: _Call) -> Shapes:
    shape = call.rows(0)
    gone = {call.axis(axis, len(shape)) for axis in call.constant(1).reshape(-1).tolist()}
    if any(shape[k] != 1 for k in gone):
        raise _ModelError
    return [tuple(size for k, size in enumerate(shape) if k not in gone)], 0


def _flatten(call: _Call) -> Shapes:
    if call.number("axis", 1) != 1:
        raise _ModelError
    return [(math.prod(call.rows(0)),)], 0


def _reshape(call: _Call) -> Shapes:
    """Allow [-1, sizes] and [0, sizes]: the rows stay."""
    shape = call.rows(0)
    batch, *wanted = call.constant(1).reshape(-1).tolist()
    if batch not in (-1, 0) or (call.number("allowzero", 0) and batch == 0):
        raise _ModelError
    if batch == 0 and wanted.count(-1) == 1:
        rest = -math.prod(wanted)
        wanted[wanted.index(-1)] = math.prod(shape) // max(rest, 1)
    if min(wanted, default=1) < 1 or math.prod(wanted) != math.prod(shape):
        raise _ModelError
    return [tuple(wanted)], 0


def _split(call: _Call) -> Shapes:
    shape = call.rows(0)
    along = call.axis(call.number("axis", 0), len(shape))
    if len(call.inputs) > 1:
        sizes = call.constant(1).reshape(-1).tolist()
    else:
        sizes = [shape[along] // call.outputs] * call.outputs
    if sum(sizes) != shape[along] or call.number("num_outputs", len(sizes)) != len(sizes):
        raise _ModelError
    return [(*shape[:along], size, *shape[along + 1 :]) for size in sizes], 0


RULES: dict[str, Callable[[_Call], Shapes]] = {
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
