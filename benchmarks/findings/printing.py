"""How findings print."""

from collections.abc import Sequence

import numpy as np


def say(text: str) -> None:
    """Print one line of a finding."""
    print(text.rstrip(), flush=True)


def spreads(values: Sequence[float], unit: str) -> str:
    """Write median, 95th percentile and largest of some figures."""
    return f"{np.median(values):.0f} / {np.percentile(values, 95):.0f} / {np.max(values):.0f} {unit}"
