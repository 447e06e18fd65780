"""Benches of these tests, and the one address at which a simulated robot listens."""

import fcntl
import tempfile
from pathlib import Path

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


@pytest.fixture(scope="module")
def address():
    """Wait until no other process of these tests has a simulated robot: all listen at the same address."""
    with open(Path(tempfile.gettempdir()) / "contactsafe-tests-robot.lock", "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
