"""The β-VAE: its loss by hand, that it learns, and that an interrupted training is the same training."""

import dataclasses
import json

import numpy as np
import pytest

pytestmark = pytest.mark.train
torch = pytest.importorskip("torch")

from tests.learning.fakes import BOARD, camera_homography, sample_masks  # noqa: E402

from contactsafe.core.errors import InvalidInputError, OutputError  # noqa: E402
from contactsafe.learning.checkpoints import load_checkpoint  # noqa: E402
from contactsafe.learning.datasets import make_dataset  # noqa: E402
from contactsafe.learning.encoder import VAE, EncoderConfig, MaskEncoder, vae_loss  # noqa: E402
from contactsafe.learning.probe import nearest_foreground  # noqa: E402
from contactsafe.learning.train_vae import VaeConfig, train_vae  # noqa: E402
from contactsafe.policy.perception import Perception, open_session  # noqa: E402

H = camera_homography()
TINY = EncoderConfig(size=32, channels=(4, 4, 8))


def tiny_config(out, **changes):
    settings = {"representation": "tool", "images": 48, "held_out": 16, "epochs": 3, "batch": 16, "warmup_epochs": 1}
    settings |= {"threads": 1, "probe_steps": 20}
    return VaeConfig(out=out, encoder=TINY, **{**settings, **changes})


def test_loss_is_the_formula():
    generator = np.random.default_rng(0)
    logits, mean, log_var = (
        generator.normal(size=(2, 1, 3, 3)),
        generator.normal(size=(2, 4)),
        generator.normal(size=(2, 4)),
    )
    ink = (generator.random((2, 1, 3, 3)) < 0.3).astype(float)
    p = 1.0 / (1.0 + np.exp(-logits))
    likelihood = (6.0 * ink * np.log(p) + (1.0 - ink) * np.log(1.0 - p)).sum() / 2
    divergence = 0.5 * (mean**2 + np.exp(log_var) - 1.0 - log_var).sum() / 2
    found = vae_loss(*(torch.tensor(x) for x in (logits, ink, mean, log_var)), kl_weight=0.7, foreground_weight=6.0)
    np.testing.assert_allclose([float(x) for x in found], [-likelihood + 0.7 * divergence, -likelihood, divergence])


def test_the_weight_of_ink_counts_ink_only():
    logits, zeros = torch.full((1, 1, 2, 2), -1.0), torch.zeros(1, 4)
    blank, inked = torch.zeros(1, 1, 2, 2), torch.ones(1, 1, 2, 2)
    losses = {w: [float(vae_loss(logits, x, zeros, zeros, 1.0, w)[0]) for x in (blank, inked)] for w in (1.0, 5.0)}
    assert losses[5.0][0] == losses[1.0][0]
    assert losses[5.0][1] == pytest.approx(5.0 * losses[1.0][1])


def test_latent_is_128_numbers_or_fewer_and_reconstruction_has_the_pictures_shape():
    for size, maps in ((32, 2), (64, 2), (128, 2), (128, 1)):
        vae = VAE(EncoderConfig(size=size, maps=maps))
        logits, mean, log_var = vae(torch.zeros(3, 1, size, size), torch.zeros(3, 64 * maps))
        assert logits.shape == (3, 1, size, size)
        assert mean.shape == log_var.shape == (3, 64 * maps)


def test_a_size_that_does_not_divide_is_refused():
    with pytest.raises(InvalidInputError) as error:
        EncoderConfig(size=100)
    assert str(error.value) == "encoder.size = 100; give a multiple of 32"


def test_learns_eight_boards_by_heart():
    torch.set_num_threads(1)
    torch.manual_seed(0)
    data = make_dataset(sample_masks, H, 8, 0, "tool", 0.64, 64)
    ink = torch.from_numpy(data.images(np.arange(8)))
    vae = VAE(EncoderConfig(size=64))
    optimiser = torch.optim.Adam(vae.parameters(), lr=5e-3)
    for _ in range(250):
        logits, mean, log_var = vae(ink, torch.randn(8, 128))
        loss = vae_loss(logits, ink, mean, log_var, 0.05, 3.0)[0]
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    with torch.no_grad():
        guess = vae.decode(vae.encode(ink)[0]) > 0
    both = (guess * ink).sum()
    assert both / ink.sum() > 0.9
    assert both / guess.sum() > 0.7


def test_dataset_is_seeded_packed_and_as_the_view_is():
    data = make_dataset(sample_masks, H, 20, 7, "paper", 0.64, 128)
    again = make_dataset(sample_masks, H, 20, 7, "paper", 0.64, 128)
    np.testing.assert_array_equal(data.packed, again.packed)
    assert data.packed.nbytes == 20 * 128 * 128 / 8
    masks = data.masks(np.arange(20))
    assert set(np.unique(masks)) == {0, 255}
    np.testing.assert_array_equal(data.images(np.arange(20))[:, 0] == 1, masks == 0)


def test_nearest_ink_is_the_vector_from_the_centre():
    ink = np.zeros((2, 1, 8, 8), np.float32)
    ink[0, 0, 4, 6] = ink[0, 0, 0, 0] = 1.0
    vectors = nearest_foreground(ink, 0.8)
    np.testing.assert_allclose(vectors[0], [0.25, 0.05])
    assert np.isnan(vectors[1]).all()


def test_resumed_training_is_the_same_training(tmp_path):
    whole = train_vae(tiny_config(tmp_path / "whole"), sample_masks, H)
    config = tiny_config(tmp_path / "parts")

    class PowerError(Exception):
        pass

    # Cut short after the second checkpoint, as a power failure would.
    import contactsafe.learning.train_vae as module

    saved = module.save_checkpoint
    module.save_checkpoint = lambda out, state: (saved(out, state), _stop_at(state, 2, PowerError))
    try:
        with pytest.raises(PowerError):
            train_vae(config, sample_masks, H)
    finally:
        module.save_checkpoint = saved
    assert load_checkpoint(config.out)["epochs_done"] == 2
    parts = train_vae(dataclasses.replace(config, resume=True), sample_masks, H)
    first, second = (load_checkpoint(tmp_path / name)["model"] for name in ("whole", "parts"))
    assert all(torch.equal(first[key], second[key]) for key in first)
    assert parts["reconstruction"] == whole["reconstruction"]
    assert not list(tmp_path.glob("*/.*"))


def _stop_at(state, epochs, error):
    if state["epochs_done"] == epochs:
        raise error


def test_exported_encoder_is_the_trained_one(tmp_path):
    report = train_vae(tiny_config(tmp_path / "run", epochs=1), sample_masks, H)
    assert json.loads((tmp_path / "run" / "encoder.json").read_text())["latent_mean"] == report["latent_mean"]
    vae = VAE(TINY)
    vae.load_state_dict(load_checkpoint(tmp_path / "run")["model"])
    data = make_dataset(sample_masks, H, 6, 3, "tool", 0.64, 32)
    masks, tools = sample_masks(6, int(np.random.SeedSequence(3).generate_state(1)[0]))
    session = open_session((tmp_path / "run" / "encoder.onnx").read_bytes(), "encoder")
    found = Perception(session, "tool", 0.64, 32, H)(masks[..., None], tools)
    with torch.no_grad():
        wanted = MaskEncoder(vae)(torch.from_numpy(data.masks(np.arange(6)))).numpy()
    np.testing.assert_allclose(found, wanted, atol=1e-4)


def test_runs_are_not_mixed_up(tmp_path):
    config = tiny_config(tmp_path / "run", epochs=1)
    with pytest.raises(InvalidInputError) as error:
        train_vae(dataclasses.replace(config, resume=True), sample_masks, H)
    assert str(error.value) == f"no checkpoint.pt in {config.out} to resume from; leave --resume out to start anew"
    train_vae(config, sample_masks, H)
    with pytest.raises(OutputError) as error:
        train_vae(config, sample_masks, H)
    assert (
        str(error.value)
        == f"{config.out} holds a training run already; give --resume to go on with it, or another --out"
    )
    with pytest.raises(InvalidInputError) as error:
        train_vae(dataclasses.replace(config, resume=True, foreground_weight=9.0), sample_masks, H)
    assert str(error.value) == (
        "the run was started with foreground_weight = 6.0, now it is 9.0; keep the setting, or start anew "
        "with another --out"
    )
    (config.out / "checkpoint.pt").write_bytes(b"no")
    with pytest.raises(InvalidInputError) as error:
        train_vae(dataclasses.replace(config, resume=True), sample_masks, H)
    assert (
        str(error.value)
        == f"{config.out / 'checkpoint.pt'} cannot be read as a checkpoint; start anew with another --out"
    )


def test_perception_refuses_an_unknown_representation_and_a_wrong_mask():
    with pytest.raises(InvalidInputError) as error:
        Perception(None, "world", 0.64, 128, H)
    assert str(error.value) == "representation is 'world'; choose one of log_polar, tool, paper"
    with pytest.raises(InvalidInputError) as error:
        Perception(None, "paper", 0.64, 128, H)(np.zeros((1, 64, 64), np.uint8), BOARD[None])
    assert str(error.value) == "masks are uint8 of shape (1, 64, 64); this encoder takes uint8 (N, 128, 128)"
