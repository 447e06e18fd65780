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


@pytest.fixture(scope="session")
def encoder(tmp_path_factory):
    """Folder of a small encoder, hardly trained."""
    pytest.importorskip("torch")
    from contactsafe.learning.encoder import EncoderConfig
    from contactsafe.learning.train_vae import VaeConfig, train_vae
    from tests.learning.fakes import camera_homography, sample_masks

    out = tmp_path_factory.mktemp("vae") / "run"
    encoder = EncoderConfig(size=32, channels=(4, 4, 8))
    small = {"images": 64, "held_out": 16, "epochs": 1, "batch": 16, "threads": 1, "probe_steps": 0}
    config = VaeConfig(out=out, representation="tool", encoder=encoder, **small)
    train_vae(config, sample_masks, camera_homography())
    return out
