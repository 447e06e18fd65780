"""Benches of these tests."""

import pytest
from tests.hardware.bench import Bench


@pytest.fixture
def bench():
    """Give a function that makes benches, and removes their shared memory afterwards."""
    made = []

    def make(*args, **kwargs):
        made.append(Bench(*args, **kwargs))
        return made[-1]

    yield make
    for one in made:
        one.close()
