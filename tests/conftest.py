"""Settings common to all tests."""

import ctypes.util
import os

import pytest
from hypothesis import HealthCheck, settings

# The first call of a compiled function takes seconds, a busy machine is no fault of the code, and a failure must come
# back on the next run.
settings.register_profile(
    "contactsafe", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True, print_blob=True
)
settings.load_profile("contactsafe")

HAS_EGL = ctypes.util.find_library("EGL") is not None
if HAS_EGL:
    os.environ.setdefault("MUJOCO_GL", "egl")  # read when mujoco is imported


def pytest_collection_modifyitems(items):
    if not HAS_EGL:
        skip = pytest.mark.skip(reason="no EGL library here; tools/system-packages.sh names the packages")
        for item in items:
            if item.get_closest_marker("render"):
                item.add_marker(skip)
