"""Compare vision encoders: how much of the ink, and the last of it, can be read off the latent of each.

`python benchmarks/vision_encoders.py` prints the table of docs/concepts/vision.md. All see the same held-out boards,
and the same small networks read them: one says where the nearest ink lies, one marks the cells of 2 cm about the tool
that hold ink. What they cannot read, a policy of that size will not learn to use.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from contactsafe.learning.encoder import EncoderConfig
from contactsafe.learning.probe import nearest_foreground
from contactsafe.learning.train_vae import HELD_OUT_MASKS_SEED, VaeConfig, train_vae
from contactsafe.policy.perception import Perception, open_session
from contactsafe.tasks.wiping.sampling import MaskSampler
from contactsafe.vision.rectify import WINDOW_M, rectify

PICTURES, HELD_OUT, VAE_PICTURES, VAE_EPOCHS = 12_000, 2_000, 12_000, 10
STEPS, BATCH = 3000, 256
CELLS = 32
"""Cells along a side of the window whose ink the second reader marks, 2 cm each."""

AMOUNTS = ((1, 6), (6, 30), (30, 120), (120, 10_000))
"""Classes of boards by how many camera pixels see ink; the first is the last speck."""

UNIT_M = 0.1

Picture = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From masks and tool positions to numbers, (n, k)."""


@dataclass(frozen=True)
class Boards:
    """Pictures and what is true of them."""

    masks: np.ndarray
    tools: np.ndarray
    nearest: np.ndarray  # vector to the nearest ink, (n, 2), m
    cells: np.ndarray  # whether each cell about the tool holds ink, (n, CELLS²)
    pixels: np.ndarray  # camera pixels that see ink, (n,)


def boards(sampler, count, seed):
    """Sample boards with ink in view."""
    masks, tools = sampler.sample(count, seed)
    fine = rectify(masks, tools, sampler.homography)
    seen = (fine == 0).any((1, 2))
    masks, tools, ink = masks[seen], tools[seen], (fine[seen] == 0)
    side = ink.shape[1] // CELLS
    cells = ink.reshape(len(ink), CELLS, side, CELLS, side).any((2, 4)).reshape(len(ink), -1)
    return Boards(
        masks, tools, nearest_foreground(ink[:, None].astype(np.float32), WINDOW_M), cells, (masks == 0).sum((1, 2))
    )


def reader(inputs, outputs):
    """Make the network that reads: that of a policy."""
    return nn.Sequential(nn.Linear(inputs, 256), nn.Tanh(), nn.Linear(256, 128), nn.Tanh(), nn.Linear(128, outputs))


def fit(model, inputs, targets, loss):
    """Fit a model to inputs and targets."""
    optimiser = torch.optim.Adam(model.parameters(), lr=1e-3)
    generator = torch.Generator().manual_seed(0)
    for step in range(STEPS):
        optimiser.param_groups[0]["lr"] = 1e-3 * (1.0 - step / STEPS)
        index = torch.randint(len(targets), (BATCH,), generator=generator)
        optimiser.zero_grad()
        loss(model(inputs[index]), targets[index]).backward()
        optimiser.step()
    return model.eval()


def near(guess, truth):
    """Return the loss of a guess at the nearest ink."""
    return functional.smooth_l1_loss(guess, truth / UNIT_M)


def marked(guess, truth):
    """Return the loss of marked cells: ink is rare, and missing it is worse than inventing it."""
    return functional.binary_cross_entropy_with_logits(guess, truth, pos_weight=torch.tensor(4.0))


def figures(train, test, numbers, test_numbers):
    """Read the numbers with fitted networks: for each amount of ink, error of the nearest, recall and precision."""
    torch.manual_seed(0)
    centre, scale = numbers.mean(0), numbers.std(0).clamp(min=0.2)
    inputs, held_out = (numbers - centre) / scale, (test_numbers - centre) / scale
    where = fit(reader(inputs.shape[1], 2), inputs, torch.from_numpy(train.nearest).float(), near)
    what = fit(reader(inputs.shape[1], CELLS**2), inputs, torch.from_numpy(train.cells).float(), marked)
    with torch.no_grad():
        return score(test, UNIT_M * where(held_out).numpy(), what(held_out).numpy() > 0)


def score(test, vectors, guess):
    """Return (median error, mm; recall; precision) for each amount of ink."""
    error = 1e3 * np.linalg.norm(vectors - test.nearest, axis=1)
    rows = []
    for low, high in AMOUNTS:
        chosen = (test.pixels >= low) & (test.pixels < high)
        both = (guess & test.cells)[chosen].sum()
        rows.append((np.median(error[chosen]), both / test.cells[chosen].sum(), both / max(guess[chosen].sum(), 1)))
    return rows


def vae_numbers(sampler, folder, representation, maps):
    """Train a β-VAE and return its `Perception`, and how many of its numbers vary."""
    config = VaeConfig(
        out=Path(folder) / f"{representation}{maps}", representation=representation, images=VAE_PICTURES,
        epochs=VAE_EPOCHS, encoder=replace(EncoderConfig(), maps=maps), probe_steps=0,
    )  # fmt: skip
    report = train_vae(config, sampler.sample, sampler.homography)
    session = open_session((config.out / "encoder.onnx").read_bytes(), "encoder")
    return Perception(session, representation, WINDOW_M, report["size"], sampler.homography), report["active_latents"]


def with_pose(look):
    """Join where the tool is to what is seen: in the camera's frame one is nothing without the other."""
    return lambda masks, tools: np.concatenate([look(masks, tools), (tools - tools.mean(0)) / 0.1], axis=1)


class Cnn(nn.Module):
    """End to end: no code between the picture in the tool's frame and the answer."""

    def __init__(self, outputs):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(1, 12, 4, 4), nn.ReLU(), nn.Conv2d(12, 24, 3, 2, 1), nn.ReLU(), nn.Conv2d(24, 32, 3, 2, 1),
            nn.ReLU(), nn.Flatten(), reader(32 * 64, outputs),
        )  # fmt: skip

    def forward(self, views):
        """Answer for views, (n, size²) uint8, 0 is ink."""
        return self.layers((views == 0).float().reshape(-1, 1, 128, 128))


def cnn_figures(train, test, homography):
    """Train the two readers on the pictures themselves."""
    views, held_out = (
        torch.from_numpy(rectify(b.masks, b.tools, homography).reshape(len(b.masks), -1)) for b in (train, test)
    )
    torch.manual_seed(0)
    where = fit(Cnn(2), views, torch.from_numpy(train.nearest).float(), near)
    what = fit(Cnn(CELLS**2), views, torch.from_numpy(train.cells).float(), marked)
    with torch.no_grad():
        return score(test, UNIT_M * where(held_out).numpy(), what(held_out).numpy() > 0)


def line(name, count, active, minutes, rows):
    """Write one row of the table."""
    cells = [f"{error:.0f} / {100 * recall:.0f} / {100 * precision:.0f}" for error, recall, precision in rows]
    print("| " + " | ".join([name, str(count), str(active), f"{minutes:.1f}", *cells]) + " |", flush=True)


def main():
    """Print the table."""
    torch.set_num_threads(1)
    sampler = MaskSampler()
    train, test = boards(sampler, PICTURES, 0), boards(sampler, HELD_OUT, HELD_OUT_MASKS_SEED)
    heads = [f"{low} to {high - 1} pixels" for low, high in AMOUNTS[:-1]] + [f"{AMOUNTS[-1][0]} and more"]
    print("| encoder | numbers | active | min | " + " | ".join(heads) + " |\n|" + "---|" * (4 + len(heads)))
    features = Perception(None, "log_polar", WINDOW_M, train.masks.shape[1], sampler.homography)
    with TemporaryDirectory() as folder:
        for name, make in (
            ("log-polar", lambda: (features, None)),
            ("β-VAE, tool's frame, 128", lambda: vae_numbers(sampler, folder, "tool", 2)),
            ("β-VAE, tool's frame, 64", lambda: vae_numbers(sampler, folder, "tool", 1)),
            ("β-VAE of the paper, and the pose", lambda: vae_numbers(sampler, folder, "paper", 2)),
        ):
            start = time.monotonic()
            look, active = make()
            minutes = (time.monotonic() - start) / 60
            look = with_pose(look) if "paper" in name else look
            numbers, test_numbers = (torch.from_numpy(look(b.masks, b.tools)).float() for b in (train, test))
            if active is None:
                active = int((numbers.std(0) ** 2 > 0.01).sum())
            line(name, numbers.shape[1], active, minutes, figures(train, test, numbers, test_numbers))
    start = time.monotonic()
    rows = cnn_figures(train, test, sampler.homography)
    line("CNN end to end, tool's frame", "", "", (time.monotonic() - start) / 60, rows)


if __name__ == "__main__":
    sys.exit(main())
