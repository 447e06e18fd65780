"""An encoder to train policies on."""

import pytest
from tests.learning.fakes import camera_homography, sample_masks


@pytest.fixture(scope="session")
def vae(tmp_path_factory):
    """Folder of a small encoder, hardly trained."""
    pytest.importorskip("torch")
    from contactsafe.learning.encoder import EncoderConfig
    from contactsafe.learning.train_vae import VaeConfig, train_vae

    out = tmp_path_factory.mktemp("vae") / "run"
    encoder = EncoderConfig(size=32, channels=(4, 4, 8))
    small = {"images": 64, "held_out": 16, "epochs": 1, "batch": 16, "threads": 1, "probe_steps": 0}
    config = VaeConfig(out=out, representation="tool", encoder=encoder, **small)
    train_vae(config, sample_masks, camera_homography())
    return out
