"""Images to train the β-VAE on, from full to nearly empty masks, a bit a pixel."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.progress import progress_bar
from contactsafe.policy.perception import LEARNED
from contactsafe.vision.rectify import rectify

CHUNK = 512


@dataclass(frozen=True)
class MaskDataset:
    """Binary images, packed.

    Attributes:
        packed: (n, size, size / 8) uint8, a bit a pixel, 1 is foreground.
    """

    packed: np.ndarray

    def __len__(self) -> int:
        return len(self.packed)

    def images(self, indices: np.ndarray) -> np.ndarray:
        """Unpack the images asked for, (len(indices), 1, size, size) float32, 1 is foreground."""
        return np.unpackbits(self.packed[indices], axis=2)[:, None].astype(np.float32)

    def masks(self, indices: np.ndarray) -> np.ndarray:
        """Unpack the images asked for as the encoder takes them, (len(indices), size, size) uint8, 0 is foreground."""
        return (1 - np.unpackbits(self.packed[indices], axis=2)) * np.uint8(255)


SampleMasks = Callable[[int, int], tuple[np.ndarray, np.ndarray]]
"""`sample_masks(n, seed)` returns camera masks (n, 128, 128) uint8 and tool positions (n, 3) in m."""


def make_dataset(
    sample_masks: SampleMasks,
    homography: np.ndarray,
    count: int,
    seed: int,
    representation: str,
    window_m: float,
    size: int,
) -> MaskDataset:
    """Sample masks and show each as the encoder will see it.

    Args:
        sample_masks: where the masks come from.
        homography: working plane to pixels, (3, 3).
        count: images to make.
        seed: of the masks; the same seed gives the same images.
        representation: "tool" (rectified to the tool's frame) or "paper" (as the camera sees it).
        window_m: side of the tool's window, m.
        size: pixels along a side.

    Returns:
        A MaskDataset of count images.

    Raises:
        InvalidInputError: representation is unknown, or "paper" masks are not of the given size.
    """
    if representation not in LEARNED:
        raise InvalidInputError(f"representation is {representation!r}; choose one of {', '.join(LEARNED)}")
    packed = np.empty((count, size, size // 8), dtype=np.uint8)
    starts = range(0, count, CHUNK)
    seeds = np.random.SeedSequence(seed).generate_state(len(starts))
    for start, chunk_seed in zip(progress_bar(starts, desc="sampling masks", unit="chunk"), seeds, strict=True):
        n = min(CHUNK, count - start)
        masks, tools = sample_masks(n, int(chunk_seed))
        if representation == "tool":
            masks = rectify(masks, tools, homography, window_m, size)
        elif masks.shape[1:] != (size, size):
            raise InvalidInputError(f"camera masks are {masks.shape[1:]} but encoder.size is {size}; make them agree")
        packed[start : start + n] = np.packbits(masks < 128, axis=2)
    return MaskDataset(packed)
