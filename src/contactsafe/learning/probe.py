"""What a latent still says: ink recall and precision by amount of ink, and where the nearest ink is."""

from itertools import pairwise

import numpy as np
import torch
from torch import nn
from torch.nn import functional

BINS = (0.0, 0.001, 0.0025, 0.005, 0.01, 0.02, 1.0)
"""Edges of the classes of pictures: share of pixels that are ink."""

NEAR = 2
"""Pixels by which a reconstruction may be off and still count in the tolerant figures."""


def batches(count, size=256):
    """Split range(count) into index arrays of at most size."""
    return [np.arange(start, min(start + size, count)) for start in range(0, count, size)]


@torch.no_grad()
def reconstruction_report(vae, data):
    """Compare reconstructed ink (probability above a half) with what was there.

    Args:
        vae: the network.
        data: a MaskDataset.

    Returns:
        For "all" and for each class "0.001-0.0025" of ink share: pictures, recall, precision and both again within
        NEAR pixels, pooled over the pixels of the class. Classes without a picture are left out.
    """
    rows = []
    for index in batches(len(data)):
        ink = torch.from_numpy(data.ink(index))
        guess = (vae.decode(vae.encode(ink)[0]) > 0.0).float()
        wide_ink, wide_guess = (functional.max_pool2d(x, 2 * NEAR + 1, 1, NEAR) for x in (ink, guess))
        sums = [ink, guess, ink * guess, ink * wide_guess, guess * wide_ink]
        rows.append(torch.stack([s.sum((1, 2, 3)) for s in sums], dim=1).numpy())
    counts = np.concatenate(rows).astype(np.float64)
    share = counts[:, 0] / (vae.config.size**2)
    report = {"all": _figures(counts)}
    for low, high in pairwise(BINS):
        chosen = (share > low) & (share <= high)
        if chosen.any():
            report[f"{low:g}-{high:g}"] = _figures(counts[chosen])
    return report


def _figures(counts):
    ink, guess, both, near_ink, near_guess = counts.sum(0)
    return {
        "pictures": len(counts),
        "recall": float(both / max(ink, 1)),
        "precision": float(both / max(guess, 1)),
        "recall_near": float(near_ink / max(ink, 1)),
        "precision_near": float(near_guess / max(guess, 1)),
    }


def nearest_ink(ink, window_m):
    """Give the vector from the centre of each picture to its nearest ink.

    Args:
        ink: (N, 1, size, size), 1 is ink.
        window_m: side of the picture, m.

    Returns:
        Vectors, (N, 2), m, columns first; NaN where there is no ink.
    """
    size = ink.shape[-1]
    axis = ((np.arange(size) + 0.5) / size - 0.5) * window_m
    distance = axis[:, None] ** 2 + axis[None, :] ** 2
    nearest = np.where(ink[:, 0] > 0, distance, np.inf).reshape(len(ink), -1).argmin(1)
    vectors = np.stack([axis[nearest % size], axis[nearest // size]], axis=1)
    vectors[ink.reshape(len(ink), -1).max(1) == 0] = np.nan
    return vectors


def nearest_ink_error(vae, data, held_out, window_m, steps, seed, count=20_000):
    """Fit a small network from latent to nearest ink and say how far off it is on held-out pictures.

    The policy has to do the same and no more; what this cannot read, PPO will not learn.

    Args:
        vae: the network.
        data: pictures to fit on.
        held_out: pictures to report on.
        window_m: side of the picture, m.
        steps: of Adam, 256 pictures each.
        seed: of weights and order.
        count: pictures of data to use at most.

    Returns:
        "median_mm" and "p90_mm" of the error; "direction_p90_deg", of the direction, where ink is 3 cm away or more;
        "guess_median_mm" of always naming the mean.
    """
    generator = torch.Generator().manual_seed(seed)
    latents, vectors = _pairs(vae, data, window_m, count)
    test_latents, test_vectors = _pairs(vae, held_out, window_m, count)
    centre, scale = latents.mean(0), latents.std(0).clamp(min=0.2)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        net = nn.Sequential(
            nn.Linear(latents.shape[1], 128), nn.Tanh(), nn.Linear(128, 64), nn.Tanh(), nn.Linear(64, 2)
        )
    optimiser = torch.optim.Adam(net.parameters(), lr=2e-3)
    unit = 0.1
    for step in range(steps):
        optimiser.param_groups[0]["lr"] = 2e-3 * (1.0 - step / steps)
        index = torch.randint(len(latents), (256,), generator=generator)
        loss = functional.smooth_l1_loss(net((latents[index] - centre) / scale), vectors[index] / unit)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    with torch.no_grad():
        guess = (net((test_latents - centre) / scale) * unit).numpy()
    truth = test_vectors.numpy()
    error = np.linalg.norm(guess - truth, axis=1)
    far = np.linalg.norm(truth, axis=1) >= 0.03
    cosine = (guess * truth).sum(1) / np.maximum(np.linalg.norm(guess, axis=1) * np.linalg.norm(truth, axis=1), 1e-9)
    blind = np.linalg.norm(vectors.numpy().mean(0) - truth, axis=1)
    return {
        "median_mm": float(1e3 * np.median(error)),
        "p90_mm": float(1e3 * np.quantile(error, 0.9)),
        "direction_p90_deg": float(np.degrees(np.quantile(np.arccos(np.clip(cosine[far], -1, 1)), 0.9)))
        if far.any()
        else 0.0,
        "guess_median_mm": float(1e3 * np.median(blind)),
    }


@torch.no_grad()
def _pairs(vae, data, window_m, count):
    latents, vectors = [], []
    for index in batches(min(count, len(data))):
        ink = data.ink(index)
        latents.append(vae.encode(torch.from_numpy(ink))[0])
        vectors.append(torch.from_numpy(nearest_ink(ink, window_m)).float())
    latents, vectors = torch.cat(latents), torch.cat(vectors)
    seen = torch.isfinite(vectors[:, 0])
    return latents[seen], vectors[seen]
