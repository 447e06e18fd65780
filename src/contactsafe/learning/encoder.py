"""The β-VAE: a mask to a Gaussian latent of 128 numbers, or another multiple of 64, and back (paper, section III-F).

Fully convolutional, so a latent number belongs to a place in the picture: two numbers for each cell of an 8 x 8 grid.
The policy reads "where is it" off that with a small network; off a dense code it would have to learn geometry first.
"""

from dataclasses import dataclass
from typing import Any, cast

import torch
from torch import nn
from torch.nn import functional

from contactsafe.core.errors import InvalidInputError

GRID = 8
"""Latent cells along a side of the picture."""


@dataclass(frozen=True)
class EncoderConfig:
    """Shape of the network.

    Attributes:
        size: pixels along a side of the picture; a multiple of 32.
        channels: feature maps after each of the three strided convolutions.
        maps: latent numbers in each of the 8 x 8 cells; 2 make the paper's 128 (section IV-A).
    """

    size: int = 128
    channels: tuple[int, int, int] = (12, 16, 32)
    maps: int = 2

    def __post_init__(self) -> None:
        """Refuse a size that the three strides do not bring down to the grid."""
        if self.size < 32 or self.size % 32:
            raise InvalidInputError(f"encoder.size = {self.size}; give a multiple of 32")
        if self.maps < 1:
            raise InvalidInputError(f"encoder.maps = {self.maps}; give 1 or more")

    @property
    def latent(self) -> int:
        """Numbers in the latent."""
        return self.maps * GRID**2


class VAE(nn.Module):
    """Encoder and decoder over binary images: 1 is foreground, 0 is none, (N, 1, size, size) float32."""

    def __init__(self, config: EncoderConfig):
        super().__init__()
        self.config = config
        patch = config.size // (4 * GRID)
        first, second, third = config.channels
        self.encoder = nn.Sequential(
            nn.Conv2d(1, first, patch, patch),
            nn.ReLU(),
            nn.Conv2d(first, second, 3, 2, padding=1),
            nn.ReLU(),
            nn.Conv2d(second, third, 3, 2, padding=1),
            nn.ReLU(),
            nn.Conv2d(third, 2 * config.maps, 1),
        )
        # Plain convolutions, their maps shuffled into place: cheaper than transposed ones, and no checkerboard.
        self.decoder = nn.Sequential(
            nn.Conv2d(config.maps, third, 3, padding=1),
            nn.ReLU(),
            nn.Conv2d(third, 4 * second, 3, padding=1),
            nn.PixelShuffle(2),
            nn.ReLU(),
            nn.Conv2d(second, 4 * first, 3, padding=1),
            nn.PixelShuffle(2),
            nn.ReLU(),
            nn.Conv2d(first, patch * patch, 1),
            nn.PixelShuffle(patch),
        )
        # Foreground is rare: start from a blank page, not from a grey one.
        nn.init.constant_(cast(torch.Tensor, self.decoder[-2].bias), -3.0)
        cast(Any, self).to(memory_format=torch.channels_last)  # a form that torch's annotations leave out

    def encode(self, image: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return mean and log-variance of the latent, each (N, latent)."""
        mean, log_var = self.encoder(image).chunk(2, dim=1)
        return mean.flatten(1), log_var.flatten(1).clamp(-10.0, 4.0)

    def decode(self, latent: torch.Tensor) -> torch.Tensor:
        """Return the logit of foreground at each pixel, (N, 1, size, size)."""
        return self.decoder(latent.reshape(-1, self.config.maps, GRID, GRID))

    def forward(self, image: torch.Tensor, noise: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Encode, sample with the given standard normal noise (N, latent), decode: (logits, mean, log_var)."""
        mean, log_var = self.encode(image)
        return self.decode(mean + noise * torch.exp(0.5 * log_var)), mean, log_var


def vae_loss(
    logits: torch.Tensor,
    image: torch.Tensor,
    mean: torch.Tensor,
    log_var: torch.Tensor,
    kl_weight: float,
    foreground_weight: float,
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Compute the paper's (24) with its sign turned, so that less is better, and with foreground pixels weighted.

    Thin strokes are under one per cent of the pixels: unweighted, the best small code is a blank image.

    Args:
        logits: log-odds of foreground, (N, 1, size, size).
        image: 1 is foreground, same shape.
        mean: of the latent, (N, latent).
        log_var: of the latent, (N, latent).
        kl_weight: the paper's β.
        foreground_weight: how many background pixels one foreground pixel counts for.

    Returns:
        Loss, reconstruction and divergence, each a scalar: sums over a picture, mean over the batch, nat.
    """
    weight = torch.as_tensor(foreground_weight, dtype=logits.dtype)
    reconstruction = functional.binary_cross_entropy_with_logits(
        logits, image, pos_weight=weight, reduction="sum"
    ) / len(image)
    divergence = 0.5 * (mean**2 + log_var.exp() - 1.0 - log_var).sum() / len(image)
    return reconstruction + kl_weight * divergence, reconstruction, divergence


class MaskEncoder(nn.Module):
    """What is exported: masks (N, size, size) uint8, foreground 0, to the latent's mean (N, latent) float32."""

    def __init__(self, vae: VAE):
        super().__init__()
        self.vae = vae

    def forward(self, mask: torch.Tensor) -> torch.Tensor:
        """Scale inside the graph, so that whoever runs it can hand over the mask as it is."""
        image = 1.0 - mask.unsqueeze(1).to(torch.float32) / 255.0
        return self.vae.encode(image)[0]
