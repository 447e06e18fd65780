"""Arrays on the stack: like any other while their function runs, and nothing of the heap."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import contactsafe
from contactsafe.core.compiled import compiled
from contactsafe.core.stack import stack_matrix, stack_vector


@compiled
def _outer(x, y, out):
    product, doubled = stack_matrix(x.shape[0], y.shape[0]), stack_vector(y.shape[0])
    for j in range(y.shape[0]):
        doubled[j] = 2.0 * y[j]
    for i in range(x.shape[0]):
        for j in range(y.shape[0]):
            product[i, j] = x[i] * doubled[j]
    out[:] = product.T


@pytest.mark.parametrize(("m", "n"), [(1, 1), (6, 7), (3, 9)])
def test_rows_and_columns_stand_where_they_belong(m, n):
    x, y, out = np.arange(m) + 1.0, np.arange(n) - 3.0, np.zeros((n, m))
    _outer(x, y, out)
    assert_array_equal(out, 2.0 * np.outer(y, x))


@compiled
def _deep(n):
    """Return n!, by a vector of its own in every call."""
    mine = stack_vector(2)
    mine[0], mine[1] = n, 1.0
    if n > 1:
        mine[1] = _deep(n - 1)
    return mine[0] * mine[1]


def test_every_call_has_its_own():
    assert _deep(10) == 3628800


_COUNT = """
import numpy as np
from numba.core.runtime import rtsys
import contactsafe as cs
from contactsafe.core.compiled import compiled
from contactsafe.control.tick import control_tick
from contactsafe.robot.dynamics import update_dynamics

@compiled
def update(controllers, times):
    c = controllers[0]
    for _ in range(times):
        update_dynamics(c.handle, c.measurement.q, c.measurement.qd, c.dynamics)

@compiled
def tick(controllers, times):
    for _ in range(times):
        control_tick(controllers[0])

def asked(function, times):
    before = rtsys.get_allocation_stats().alloc
    function(records, times)
    return rtsys.get_allocation_stats().alloc - before

arm = cs.robots.panda()
records = np.zeros(1, dtype=cs.Controller(arm, cs.presets.safe()).record.dtype)
controller = cs.Controller(arm, cs.presets.safe(), records=records)
controller.reset(arm.home)
target = cs.Target(arm.tool_pose(arm.home), stiffness=[150.0] * 6)
controller.step(cs.Measurement(arm.home, [0.0] * 7, wrench_ee=[0.0] * 6), target)
for function in (update, tick):
    function(records, 1)  # counting begins with the first compiled call
    # Handing arrays over from Python asks for some, whatever is done with them.
    print((asked(function, 11) - asked(function, 1)) / 10)
"""


def test_how_often_a_tick_asks_the_heap(tmp_path):
    """Never for the dynamics; in free motion no more often than when this was written: a heap may keep it waiting."""
    environment = {**os.environ, "NUMBA_NRT_STATS": "1"}
    script = tmp_path / "count.py"  # a file: what is typed in cannot be cached
    script.write_text(_COUNT)
    done = subprocess.run([sys.executable, str(script)], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    dynamics, tick = map(float, done.stdout.split())
    assert dynamics == 0.0
    assert tick <= 26.0


def _is_of_the_stack(node, names):
    """Tell whether an expression is an array of the frame: made there, filled and handed back, or a part of one."""
    if isinstance(node, ast.Subscript):
        return isinstance(node.slice, ast.Slice) and _is_of_the_stack(node.value, names)
    if isinstance(node, ast.Call):
        called = ast.unparse(node.func)
        handed_back = called.endswith("_into") and any(_is_of_the_stack(given, names) for given in node.args)
        return called in ("stack_vector", "stack_matrix") or handed_back
    return isinstance(node, ast.Name) and node.id in names


def _pairs(node):
    """Give targets and values of an assignment, one by one."""
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    for target in targets:
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            yield from zip(target.elts, node.value.elts, strict=False)  # one may be starred
        else:
            yield target, node.value


def _named_arrays(function):
    """Give the names that a function has for arrays of its own frame."""
    names = set()
    for node in (node for node in ast.walk(function) if isinstance(node, ast.Assign | ast.AnnAssign) and node.value):
        made = [to for to, value in _pairs(node) if _is_of_the_stack(value, names)]
        names |= {to.id for to in made if isinstance(to, ast.Name)}
    return names


def handed_out(source):
    """Give the functions of a source that return an array of their own frame."""
    found = []
    for function in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)):
        names = _named_arrays(function)
        values = [node.value for node in ast.walk(function) if isinstance(node, ast.Return) and node.value]
        parts = [part for value in values for part in (value.elts if isinstance(value, ast.Tuple) else [value])]
        found += [function.name for part in parts if _is_of_the_stack(part, names)]
    return found


@pytest.mark.parametrize(
    "body",
    [
        "return stack_vector(3)",
        "x, y = stack_vector(3), 1.0; return y, x",
        "x = stack_vector(3); y = x; return y[:2]",
        "return matvec_into(A, b, stack_vector(3))",
        "x = fill_into(b, stack_vector(3)); return x",
    ],
)
def test_arrays_that_are_handed_out_are_found(body):
    assert handed_out(f"def f(A, b): {body}") == ["f"]
    assert handed_out("def f(A, b): x = stack_vector(3); return 1.0 / dot(b, x), x[0]") == []


def test_no_function_hands_out_an_array_of_its_own_frame():
    """It works until something else is laid over it: forces that nobody felt once came of that."""
    sources = sorted(Path(contactsafe.__file__).parent.rglob("*.py"))
    assert {path.name: handed_out(path.read_text(encoding="utf-8")) for path in sources} == {
        path.name: [] for path in sources
    }
