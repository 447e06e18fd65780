"""Arrays on the stack: like any other while their function runs, and nothing of the heap."""

import os
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from contactsafe.compiled import compiled
from contactsafe.robot.stack import stack_matrix, stack_vector


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
    """Give n!, by a vector of its own in every call."""
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
from contactsafe.compiled import compiled
from contactsafe.robot import robots
from contactsafe.robot.dynamics import dynamics_dtype, update_dynamics

@compiled
def update(handle, q, qd, out, times):
    for _ in range(times):
        update_dynamics(handle, q, qd, out)

def asked(times):
    before = rtsys.get_allocation_stats().alloc
    update(nominal.handle, arm.home, arm.home, out[0], times)
    return rtsys.get_allocation_stats().alloc - before

arm = robots.panda()
nominal, out = arm.nominal(), np.zeros(1, dtype=dynamics_dtype(arm.n))
update(nominal.handle, arm.home, arm.home, out[0], 1)  # counting begins with the first compiled call
print(asked(100) - asked(1))  # handing arrays over from Python asks for some, whatever is done with them
"""


def test_the_dynamics_ask_the_heap_for_nothing(tmp_path):
    environment = {**os.environ, "NUMBA_NRT_STATS": "1"}
    script = tmp_path / "count.py"  # a file: what is typed in cannot be cached
    script.write_text(_COUNT)
    done = subprocess.run([sys.executable, str(script)], env=environment, capture_output=True, text=True, check=True)
    assert int(done.stdout) == 0
