"""What can be read off a latent: recall and precision by amount of foreground, and where the nearest of it is."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from contactsafe.learning.datasets import MaskDataset
from contactsafe.learning.encoder import VAE

BINS = (0.0, 0.001, 0.0025, 0.005, 0.01, 0.02, 1.0)
"""Edges of the classes of pictures: fraction of pixels that are foreground."""

NEAR = 2
"""Pixels by which a reconstruction may be off and still count in the tolerant figures."""


def batches(count: int, size: int = 256) -> list[np.ndarray]:
    """Split range(count) into index arrays of at most size."""
    return [np.arange(start, min(start + size, count)) for start in range(0, count, size)]


@torch.no_grad()
def reconstruction_report(vae: VAE, data: MaskDataset) -> dict[str, dict[str, float]]:
    """Compare the reconstructed foreground (probability above a half) with what was there.

    Args:
        vae: the network.
        data: a MaskDataset.

    Returns:
        For "all" and for each class "0.001-0.0025" of foreground fraction: images, recall, precision and both again
        within NEAR pixels, pooled over the pixels of the class. Classes without an image are left out.
    """
    rows = []
    for index in batches(len(data)):
        image = torch.from_numpy(data.images(index))
        guess = (vae.decode(vae.encode(image)[0]) > 0.0).float()
        wide_image, wide_guess = (functional.max_pool2d(x, 2 * NEAR + 1, 1, NEAR) for x in (image, guess))
        sums = [image, guess, image * guess, image * wide_guess, guess * wide_image]
        rows.append(torch.stack([s.sum((1, 2, 3)) for s in sums], dim=1).numpy())
    counts = np.concatenate(rows).astype(np.float64)
    fraction = counts[:, 0] / (vae.config.size**2)
    report = {"all": _figures(counts)}
    for low, high in pairwise(BINS):
        chosen = (fraction > low) & (fraction <= high)
        if chosen.any():
            report[f"{low:g}-{high:g}"] = _figures(counts[chosen])
    return report


def _figures(counts: np.ndarray) -> dict[str, float]:
    there, guess, both, near_there, near_guess = counts.sum(0)
    return {
        "images": len(counts),
        "recall": float(both / max(there, 1)),
        "precision": float(both / max(guess, 1)),
        "recall_near": float(near_there / max(there, 1)),
        "precision_near": float(near_guess / max(guess, 1)),
    }


def nearest_foreground(image: np.ndarray, window_m: float) -> np.ndarray:
    """Return the vector from the centre of each image to its nearest foreground pixel.

    Args:
        image: (N, 1, size, size), 1 is foreground.
        window_m: side of the image, m.

    Returns:
        Vectors, (N, 2), m, columns first; NaN where there is none.
    """
    size = image.shape[-1]
    axis = ((np.arange(size) + 0.5) / size - 0.5) * window_m
    distance = axis[:, None] ** 2 + axis[None, :] ** 2
    nearest = np.where(image[:, 0] > 0, distance, np.inf).reshape(len(image), -1).argmin(1)
    vectors = np.stack([axis[nearest % size], axis[nearest // size]], axis=1)
    vectors[image.reshape(len(image), -1).max(1) == 0] = np.nan
    return vectors


def nearest_foreground_error(
    vae: VAE,
    data: MaskDataset,
    held_out: MaskDataset,
    window_m: float,
    steps: int,
    seed: int,
    count: int = 20_000,
) -> dict[str, float]:
    """Fit a small network from latent to nearest foreground and say how far off it is on held-out images.

    The policy has to do the same and no more; what this cannot read, PPO will not learn.

    Args:
        vae: the network.
        data: images to fit on.
        held_out: images to report on.
        window_m: side of the image, m.
        steps: of Adam, 256 images each.
        seed: of weights and order.
        count: images of data to use at most.

    Returns:
        "median_mm" and "p90_mm" of the error; "direction_p90_deg", of the direction, where that is 3 cm away or more;
        "guess_median_mm" of always naming the mean.
    """
    latents, vectors = _pairs(vae, data, window_m, count)
    test_latents, test_vectors = _pairs(vae, held_out, window_m, count)
    guess = _fitted_reader(latents, vectors, steps, seed)(test_latents)
    return _reader_errors(guess, test_vectors.numpy(), vectors.numpy().mean(0))


def _fitted_reader(
    latents: torch.Tensor, vectors: torch.Tensor, steps: int, seed: int
) -> Callable[[torch.Tensor], np.ndarray]:
    """Fit a small network from latents to vectors; return what reads vectors off latents, (N, 2), m."""
    generator = torch.Generator().manual_seed(seed)
    centre, scale = latents.mean(0), latents.std(0).clamp(min=0.2)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        first = nn.Linear(latents.shape[1], 128)
        net = nn.Sequential(first, nn.Tanh(), nn.Linear(128, 64), nn.Tanh(), nn.Linear(64, 2))
    optimiser, unit = torch.optim.Adam(net.parameters(), lr=2e-3), 0.1
    for step in range(steps):
        optimiser.param_groups[0]["lr"] = 2e-3 * (1.0 - step / steps)
        index = torch.randint(len(latents), (256,), generator=generator)
        loss = functional.smooth_l1_loss(net((latents[index] - centre) / scale), vectors[index] / unit)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()

    def read(seen: torch.Tensor) -> np.ndarray:
        with torch.no_grad():
            return (net((seen - centre) / scale) * unit).numpy()

    return read


def _reader_errors(guess: np.ndarray, truth: np.ndarray, mean: np.ndarray) -> dict[str, float]:
    error = np.linalg.norm(guess - truth, axis=1)
    far = np.linalg.norm(truth, axis=1) >= 0.03
    cosine = (guess * truth).sum(1) / np.maximum(np.linalg.norm(guess, axis=1) * np.linalg.norm(truth, axis=1), 1e-9)
    blind = np.linalg.norm(mean - truth, axis=1)
    return {
        "median_mm": float(1e3 * np.median(error)),
        "p90_mm": float(1e3 * np.quantile(error, 0.9)),
        "direction_p90_deg": float(np.degrees(np.quantile(np.arccos(np.clip(cosine[far], -1, 1)), 0.9)))
        if far.any()
        else 0.0,
        "guess_median_mm": float(1e3 * np.median(blind)),
    }


@torch.no_grad()
def _pairs(vae: VAE, data: MaskDataset, window_m: float, count: int) -> tuple[torch.Tensor, torch.Tensor]:
    pairs = []
    for index in batches(min(count, len(data))):
        image = data.images(index)
        latent = vae.encode(torch.from_numpy(image))[0]
        pairs.append((latent, torch.from_numpy(nearest_foreground(image, window_m)).float()))
    latents, vectors = (torch.cat(pieces) for pieces in zip(*pairs, strict=True))
    seen = torch.isfinite(vectors[:, 0])
    return latents[seen], vectors[seen]
