"""What an ONNX file may hold, read and checked before ONNX Runtime sees any of it.

A model is taken if what it costs can be told from the file. An operator is allowed if RULES says what shape comes out
of it; there are no loops, branches, functions or other files. A value is a constant, or it has a row for each of the
batch and a size of its own beside; no operator mixes rows. So memory and time are at most the stated ones times the
rows asked for, whatever the numbers are, and nothing has to be tried out to know.

ONNX Runtime gets the model written anew from what was read: nothing that was not looked at.
"""

import functools
import math
from typing import Any, NamedTuple

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError

from contactsafe.core.errors import BundleError, shown
from contactsafe.policy.operators import FLOAT, RULES, Call, NotAllowed, Value

OPSETS = (13, 23)
"""Versions of ONNX's own operators that are read; exported is 18."""

MAX_NODES = 256
MAX_RANK = 6
MAX_ROW_NUMBERS = 16_000_000
"""Most numbers computed for one row of the batch, and weights used, over all operators."""

MAX_ROW_PRODUCTS = 1_000_000_000
"""Most multiplications for one row of the batch: a fraction of a second's work."""

_UINT8, _INT64 = 2, 7
KINDS = {FLOAT: "float", _UINT8: "uint8", _INT64: "int64"}
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


Ports = dict[str, tuple[str, list[int]]]
"""Inputs or outputs by name: kind of number, such as "float", and shape without the batch."""


class Graph(NamedTuple):
    """A checked model.

    Attributes:
        model: its bytes, for ONNX Runtime.
        inputs, outputs: by name the type, as ONNX Runtime writes it, and the shape; a free size is None.
    """

    model: bytes
    inputs: dict[str, tuple[str, list]]
    outputs: dict[str, tuple[str, list]]


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


def check_ports(graph: Graph, name: str, inputs: Ports, outputs: Ports) -> None:
    """Refuse a model with other inputs and outputs than wanted.

    Args:
        graph: the model.
        name: what to call it in errors.
        inputs, outputs: wanted.

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
        values[name] = Value(tuple(shape[1:]))
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


def _constant(tensor: Any) -> Value:
    """Read the numbers of a tensor that stands in the file."""
    name = shown(tensor.name)
    if tensor.external_data or tensor.data_location:
        raise _ModelError("keeps weights in another file", "export it with the weights inside")
    shape = tuple(tensor.dims)
    if tensor.data_type not in (FLOAT, _INT64) or len(shape) > MAX_RANK or any(size < 1 for size in shape):
        raise _ModelError(f"has weights {name} of type {tensor.data_type} and shape {shown(shape)}")
    kind = np.dtype("<f4" if tensor.data_type == FLOAT else "<i8")
    listed = tensor.float_data if tensor.data_type == FLOAT else tensor.int64_data
    given = [bool(tensor.raw_data), bool(tensor.float_data), bool(tensor.int64_data)]
    length = len(tensor.raw_data) / kind.itemsize if tensor.raw_data else len(listed)
    if sum(given) != 1 or length != math.prod(shape):
        raise _ModelError(f"has weights {name} of shape {shown(shape)} without as many numbers")
    numbers = np.frombuffer(tensor.raw_data, kind) if tensor.raw_data else np.array(listed, kind)
    if not np.isfinite(numbers).all():
        raise _ModelError(f"has weights {name} that are not finite")
    return Value(shape, numbers.reshape(shape))


def _port(port: Any) -> tuple[str, list]:
    tensor = port.type.tensor_type
    shape = [dim.dim_value if dim.HasField("dim_value") else None for dim in tensor.shape.dim]
    if len(shape) > MAX_RANK + 1 or any(size is not None and not 1 <= size <= MAX_ROW_NUMBERS for size in shape):
        raise _ModelError(f"has a port {shown(port.name)} of shape {shown(shape)}")
    return f"tensor({KINDS.get(tensor.elem_type, tensor.elem_type)})", shape


def _check_nodes(nodes: Any, values: dict[str, Value]) -> None:
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
        if not node.output:  # some rules divide by their number
            raise _ModelError(f"has an operator {node.op_type} without outputs")
        try:
            shapes, cost = rule(Call(node, [values[name] if name else None for name in node.input]))
        except (NotAllowed, ArithmeticError, LookupError, TypeError, ValueError):
            raise _ModelError(f"has an operator {node.op_type} of a kind that nothing here exports") from None
        if len(shapes) != len(node.output) or any(
            len(shape) > MAX_RANK or min(shape, default=1) < 1 for shape in shapes
        ):
            raise _ModelError(f"has an operator {node.op_type} with {len(node.output)} outputs {shown(shapes)}")
        # Weights count wherever they are used: ONNX Runtime arranges them anew for each operator.
        used = [values[name].constant for name in node.input if name]
        numbers += sum(math.prod(shape) for shape in shapes) + sum(
            weights.size for weights in used if weights is not None
        )
        products += cost
        if numbers > MAX_ROW_NUMBERS or products > MAX_ROW_PRODUCTS:
            raise _ModelError(
                f"computes more than {MAX_ROW_NUMBERS} numbers or {MAX_ROW_PRODUCTS} products for one observation"
            )
        values.update(zip(node.output, map(Value, shapes), strict=True))
