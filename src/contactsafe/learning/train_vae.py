"""Prepare the vision encoder: train the β-VAE on masks from the simulator, or measure the log-polar features."""

import contextlib
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import torch

from contactsafe.core.parse import one_of
from contactsafe.core.progress import progress_bar
from contactsafe.learning.checking import check_like, check_optimiser, entry, whole
from contactsafe.learning.checkpoints import load_checkpoint, refused_as, run_folder, save_checkpoint, write_json
from contactsafe.learning.curves import EventFile
from contactsafe.learning.datasets import MaskDataset, SampleMasks, make_dataset
from contactsafe.learning.encoder import VAE, EncoderConfig, vae_loss
from contactsafe.learning.export import export_encoder
from contactsafe.learning.probe import batches, nearest_foreground_error, reconstruction_report
from contactsafe.learning.run_settings import check_same_config, plain
from contactsafe.policy.bundle import ENCODER, ENCODER_DESCRIPTION
from contactsafe.policy.perception import ENCODER_FORMAT, Perception
from contactsafe.tasks import DEFAULT_TASK, TASKS
from contactsafe.tasks.base.registry import TASK_FORM
from contactsafe.vision.rectify import WINDOW_M

_MAY_DIFFER = ("out", "resume", "threads", "held_out", "probe_steps")
"""Settings that may change when a run goes on."""

HELD_OUT_MASKS_SEED = 1_000_003
"""Added to the seed for masks that are never trained on."""


@dataclass(frozen=True)
class VaeConfig:
    """Settings of the β-VAE and its training.

    Attributes:
        task: whose masks are seen.
        out: folder of the run: checkpoint, TensorBoard log, encoder.onnx, encoder.json.
        resume: go on from the checkpoint in out.
        representation: "log_polar" has features of the mask about the tool and needs no training: nothing but their
            statistics is measured; "tool" trains the β-VAE on the mask in the tool's frame, "paper" on the camera's.
        window_m: side of the tool's window, m.
        encoder: shape of the network.
        images: masks to train on.
        held_out: masks to report on.
        epochs: passes over the masks.
        batch: masks in a step.
        learning_rate: of Adam; falls to a fiftieth along a half cosine.
        kl_weight: the paper's β.
        warmup_epochs: over which β rises from 0.
        foreground_weight: how many background pixels one foreground pixel counts for.
        probe_steps: of fitting the reader of "where is the nearest foreground" for the report; 0 for none.
        seed: of masks, weights and noise.
        threads: torch's. More than one crawls as soon as anything else wants a core.
    """

    task: Annotated[str, one_of(TASKS, also=TASK_FORM)] = DEFAULT_TASK
    out: Path = Path("runs/vae")
    resume: bool = False
    representation: Literal["log_polar", "tool", "paper"] = "log_polar"
    window_m: float = WINDOW_M
    encoder: EncoderConfig = field(default_factory=EncoderConfig)
    images: int = 20_000
    held_out: int = 2_000
    epochs: int = 16
    batch: int = 64
    learning_rate: float = 2e-3
    kl_weight: float = 0.3
    warmup_epochs: int = 4
    foreground_weight: float = 6.0
    probe_steps: int = 4000
    seed: int = 0
    threads: int = 1


def train_vae(config: VaeConfig, sample_masks: SampleMasks, homography: np.ndarray) -> dict[str, Any]:
    """Train, report and export; a run cut short goes on from its last epoch with `resume`, to the same weights.

    Args:
        config: the settings.
        sample_masks: where the masks come from.
        homography: working plane to camera pixels, (3, 3).

    Returns:
        The report written to encoder.json, a dict.

    Raises:
        OutputError: out cannot be written, or holds another run.
        InvalidInputError: nothing to resume, or settings differ from those the run was started with.
    """
    with run_folder(config.out, config.resume) as out:
        train = _report_log_polar if config.representation == "log_polar" else _train
        report = train(config, sample_masks, homography, out)
        write_json(out / ENCODER_DESCRIPTION, report)
    return report


def _train(config: VaeConfig, sample_masks: SampleMasks, homography: np.ndarray, out: Path) -> dict[str, Any]:
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed)
    vae = VAE(config.encoder)
    optimiser = torch.optim.Adam(vae.parameters(), lr=config.learning_rate)
    first_epoch = _go_on(config, vae, optimiser, out) if config.resume else 0
    view = (config.representation, config.window_m, config.encoder.size)
    data = make_dataset(sample_masks, homography, config.images, config.seed, *view)
    held_out = make_dataset(sample_masks, homography, config.held_out, config.seed + HELD_OUT_MASKS_SEED, *view)

    with contextlib.closing(EventFile(out)) as log:
        for epoch in range(first_epoch, config.epochs):
            losses = _train_epoch(vae, optimiser, data, epoch, config)
            log.write({f"train/{name}": value for name, value in losses.items()}, epoch)
            state = {"model": vae.state_dict(), "optimiser": optimiser.state_dict()}
            save_checkpoint(out, {**state, "epochs_done": epoch + 1, "config": plain(config)})
            found = reconstruction_report(vae, held_out)["all"]
            log.write({f"held_out/{name}": value for name, value in found.items()}, epoch)

    report = _report(vae, data, held_out, config)
    export_encoder(vae, out / ENCODER, report["size"])
    return report


def _go_on(config: VaeConfig, vae: VAE, optimiser: torch.optim.Optimizer, out: Path) -> int:
    """Load network and optimiser from the checkpoint; return how many epochs they have seen."""
    state = load_checkpoint(out)
    with refused_as(out):
        check_same_config(entry(state, "config", dict), config, may_differ=_MAY_DIFFER)
        check_like(entry(state, "model", dict), dict(vae.state_dict()), "model")
        check_optimiser(entry(state, "optimiser", dict), optimiser, "optimiser")
        first_epoch = whole(state, "epochs_done")
    vae.load_state_dict(state["model"])
    optimiser.load_state_dict(state["optimiser"])
    return first_epoch


def _train_epoch(
    vae: VAE, optimiser: torch.optim.Optimizer, data: MaskDataset, epoch: int, config: VaeConfig
) -> dict[str, float]:
    """Run one pass in an order and with noise that depend on seed and epoch alone: a resumed run is the same run."""
    order = np.random.default_rng([config.seed, epoch]).permutation(len(data))
    noise = torch.Generator().manual_seed(config.seed * 100_003 + epoch)
    steps = max(1, len(data) // config.batch)
    totals = np.zeros(3)
    name = f"VAE epoch {epoch + 1}/{config.epochs}"
    for step in progress_bar(range(steps), desc=name, unit="batch", mininterval=1.0):
        progress = epoch + step / steps
        for group in optimiser.param_groups:
            falling = 0.5 * (1.0 + math.cos(math.pi * progress / config.epochs))
            group["lr"] = config.learning_rate * (0.02 + 0.98 * falling)
        kl_weight = config.kl_weight * min(1.0, progress / max(config.warmup_epochs, 1e-9))
        image = torch.from_numpy(data.images(order[step * config.batch : (step + 1) * config.batch]))
        logits, mean, log_var = vae(image, torch.randn((len(image), config.encoder.latent), generator=noise))
        loss, *terms = vae_loss(logits, image, mean, log_var, kl_weight, config.foreground_weight)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(vae.parameters(), 1000.0)
        optimiser.step()
        totals += [float(loss.detach()), *(float(term.detach()) for term in terms)]
    return dict(zip(("loss", "reconstruction", "divergence"), totals / steps, strict=True))


def _report_log_polar(
    config: VaeConfig, sample_masks: SampleMasks, homography: np.ndarray, out: Path
) -> dict[str, Any]:
    """Measure the statistics of the log-polar features; they are of order one as they are."""
    masks, tools = sample_masks(config.held_out, config.seed)
    size = masks.shape[1]
    latents = Perception(None, "log_polar", config.window_m, size, homography)(masks, tools)
    return _description(config, size, latents.mean(0), np.maximum(latents.std(0), 1.0))


def _description(config: VaeConfig, size: int, mean: np.ndarray, std: np.ndarray) -> dict[str, Any]:
    return {
        "format": ENCODER_FORMAT,
        "representation": config.representation,
        "window_m": config.window_m,
        "size": size,
        "latent_mean": mean.tolist(),
        "latent_std": std.tolist(),
        # Burda et al. 2016: a number is in use if its mean moves with the image, variance above 0.01.
        "active_latents": int((std**2 > 0.01).sum()),
        "config": plain(config),
    }


@torch.no_grad()
def _latent_statistics(vae: VAE, data: MaskDataset, count: int = 4096) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and standard deviation of each latent number over up to count masks, each (128,)."""
    chunks = batches(min(count, len(data)))
    means = torch.cat([vae.encode(torch.from_numpy(data.images(chunk)))[0] for chunk in chunks])
    return means.mean(0).numpy(), means.std(0, correction=0).numpy()


def _report(vae: VAE, data: MaskDataset, held_out: MaskDataset, config: VaeConfig) -> dict[str, Any]:
    vae.eval()
    mean, std = _latent_statistics(vae, data)
    report = _description(config, config.encoder.size, mean, std)
    report["reconstruction"] = reconstruction_report(vae, held_out)
    if config.representation == "tool" and config.probe_steps:
        report["nearest_foreground"] = nearest_foreground_error(
            vae, data, held_out, config.window_m, config.probe_steps, config.seed
        )
    return report
