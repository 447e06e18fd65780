"""The vision encoder that a policy is trained with: read from what `contactsafe train vae` left, checked, started."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from contactsafe.core.errors import BundleError, InvalidInputError, shown
from contactsafe.learning.checkpoints import CHECKPOINT
from contactsafe.policy.bundle import ENCODER, ENCODER_DESCRIPTION, MAX_MODEL_BYTES
from contactsafe.policy.manifest import BOUNDS, MAX_LATENT, MAX_MANIFEST_BYTES, digest, read_bounded
from contactsafe.policy.onnx_graph import check_ports, read_graph
from contactsafe.policy.perception import ENCODER_FORMAT, LEARNED, WITH_IMAGE, Perception, encoder_ports, open_session


@dataclass(frozen=True)
class VisionEncoder:
    """A vision encoder.

    Attributes:
        folder: where it was read.
        model: bytes of encoder.onnx; None where it is not learned.
        description: what encoder.json says.
        digest: SHA-256 of both.
    """

    folder: Path
    model: bytes | None
    description: dict[str, Any]
    digest: str

    @classmethod
    def load(cls, folder: Path) -> "VisionEncoder":
        """Read and check a vision encoder.

        Raises:
            InvalidInputError: there is none in the folder, it is of another version, or holds what cannot be.
        """
        anew = f"run `contactsafe train vae --out {folder}`"
        try:
            text = read_bounded(folder, ENCODER_DESCRIPTION, MAX_MANIFEST_BYTES)
            description = json.loads(text)
            learned = description["representation"] in LEARNED
            model = read_bounded(folder, ENCODER, MAX_MODEL_BYTES) if learned else None
            version = description["format"]
        except (BundleError, ValueError, KeyError, TypeError, RecursionError) as error:
            remedy = f"{anew} first"
            if (folder / CHECKPOINT).exists():
                remedy = "it is a run; give the folder in which `contactsafe train vae` has come to its end"
            raise InvalidInputError(
                f"{folder} holds no vision encoder ({ENCODER_DESCRIPTION}, and {ENCODER} where it is learned); {remedy}"
            ) from error
        path = folder / ENCODER_DESCRIPTION
        if version != ENCODER_FORMAT:
            raise InvalidInputError(
                f"{path} has format {shown(version)}, this version reads {ENCODER_FORMAT}; {anew} anew"
            )
        if not _is_valid(description):
            raise InvalidInputError(f"{path} holds numbers that cannot be; {anew} anew")
        return cls(folder, model, description, digest((model or b"") + text))

    @property
    def latent_size(self) -> int:
        """Numbers in the latent."""
        return len(self.description["latent_mean"])

    def perception(self, homography: np.ndarray, threads: int) -> Perception:
        """Start the encoder for the masks of a camera.

        Args:
            homography: working plane to camera pixels, (3, 3).
            threads: ONNX Runtime's.
        """
        session, size = None, self.description["size"]
        if self.model is not None:
            name = str(self.folder / ENCODER)
            graph = read_graph(self.model, name)
            check_ports(graph, name, *encoder_ports(size, self.latent_size))
            session = open_session(graph, name, threads)
        view = self.description["representation"], self.description["window_m"], size
        return Perception(session, *view, homography, threaded=True)


def _is_valid(description: dict[str, Any]) -> bool:
    """Tell whether what encoder.json says can be used as it is."""
    bounds = {"size": BOUNDS["view_size"], "window_m": BOUNDS["window_m"]}
    mean, std = description.get("latent_mean"), description.get("latent_std")
    return (
        description["representation"] in WITH_IMAGE
        and all(isinstance(description.get(name), int | float) for name in bounds)
        and isinstance(description["size"], int)
        and all(low <= description[name] <= high for name, (low, high) in bounds.items())
        and isinstance(mean, list)
        and isinstance(std, list)
        and 1 <= len(mean) == len(std) <= MAX_LATENT
        and all(isinstance(number, int | float) and abs(number) < 1e6 for number in mean + std)
    )
