"""Types of what compiled functions take, for readers and type checkers; nothing checks them when code runs."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
"""One-dimensional, of 64-bit floats."""

Matrix = NDArray[np.float64]
"""Two-dimensional, of 64-bit floats."""

Record = Any
"""A NumPy record, whose fields compiled code reads and writes by name; the docstring says of which dtype."""
