"""From trained networks to files that are shipped: an encoder, and a bundle put in place in one step."""

import os
import shutil
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import torch
from torch import nn

from contactsafe.core.errors import BundleError, OutputError
from contactsafe.core.files import cannot_write, write_whole
from contactsafe.learning.checkpoints import write_json
from contactsafe.learning.encoder import VAE, MaskEncoder
from contactsafe.learning.onnx_models import DeployedPolicy, compare, to_onnx
from contactsafe.policy.action_config import ACTIONS
from contactsafe.policy.bundle import ENCODER, POLICY, Bundle
from contactsafe.policy.manifest import FORMAT, MANIFEST, digest
from contactsafe.policy.observation import ObservationScaling


def export_encoder(vae: VAE, path: Path | str, size: int) -> None:
    """Write the encoder of a trained VAE as ONNX, atomically, after comparing it with torch.

    Args:
        vae: the trained network.
        path: where to.
        size: pixels along a side of its image.

    Raises:
        ContactSafeError: the exported model computes something else.
        OutputError: path cannot be written.
    """
    encoder = MaskEncoder(vae)
    generator = torch.Generator().manual_seed(0)
    examples = (255 * (torch.rand((5, size, size), generator=generator) > 0.02)).to(torch.uint8)
    data = to_onnx(encoder, [examples[:2]], ["mask"], "latent")
    compare(encoder, data, str(path), [examples], ["mask"])
    write_whole(Path(path), data)


def export_bundle(
    folder: Path | str,
    encoder: bytes | None,
    layers: nn.Module,
    scaling: ObservationScaling,
    description: dict[str, Any],
    force: bool = False,
) -> Path:
    """Write a bundle: its models, bundle.json with their digests, the whole read back before it takes its place.

    Args:
        folder: where to; made anew.
        encoder: bytes of encoder.onnx; None for a representation that has none.
        layers: the trained policy network, scaled observation (N, k) to the mean of the first actions, all or some.
        scaling: that it was trained with.
        description: task, conditions, representation, latent_size, window_m and view_size where it sees images,
            observes, rate_hz, action_repeat, dither, training, results.
        force: replace a folder that is there.

    Returns:
        The folder as a Path.

    Raises:
        OutputError: the folder exists and force is false, or cannot be written.
        ContactSafeError: the exported policy computes something else than the trained one.
    """
    folder = Path(folder)
    if folder.exists() and not force:
        raise OutputError(f"{folder} exists; pass force=True to replace it, or give another folder")
    if folder.exists() and any(folder.iterdir()) and not (folder / MANIFEST).is_file():
        raise OutputError(f"{folder} is no bundle and will not be replaced; give another folder")
    policy = _export_policy(layers, scaling, description)
    models = {POLICY: policy} if encoder is None else {ENCODER: encoder, POLICY: policy}
    manifest = {
        "format": FORMAT,
        **description,
        "actions": list(ACTIONS),
        "observation_scaling": scaling.as_dict(),
        "files": {name: {"bytes": len(data), "sha256": digest(data)} for name, data in models.items()},
        "versions": {name: version(name) for name in ("torch", "stable-baselines3", "onnx", "onnxruntime", "numpy")},
    }
    _write(folder, models, manifest)
    return folder


def _export_policy(layers: nn.Module, scaling: ObservationScaling, description: dict[str, Any]) -> bytes:
    """Return the policy as ONNX, after comparing it with torch."""
    module = DeployedPolicy(layers, scaling)
    generator = torch.Generator().manual_seed(0)
    sizes = {"state": sum(vector["size"] for vector in description["observes"]), "latent": description["latent_size"]}
    inputs = [name for name, size in sizes.items() if size]
    examples = [3.0 * torch.randn((64, sizes[name]), generator=generator) for name in inputs]
    policy = to_onnx(module, [x[:2] for x in examples], inputs, "action")
    compare(module, policy, POLICY, examples, inputs)
    return policy


def _write(folder: Path, models: dict[str, bytes], manifest: dict[str, Any]) -> None:
    """Write all files beside the folder, read them back, and put them in its place."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        staged = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    except OSError as error:
        raise cannot_write(folder, error) from None
    try:
        staged.chmod(0o755)
        for name, data in models.items():
            write_whole(staged / name, data)
        write_json(staged / MANIFEST, manifest)
        Bundle.load(staged)
        _put_in_place(staged, folder)
    except OutputError as error:
        raise OutputError(f"{error}; nothing was changed") from None
    except (OSError, BundleError) as error:
        raise OutputError(f"cannot write {folder}: {error}; nothing was changed") from error
    finally:
        shutil.rmtree(staged, ignore_errors=True)


def _put_in_place(staged: Path, folder: Path) -> None:
    """Rename; a folder that was there is moved aside first and brought back if that fails.

    What somebody else has put into it comes along.
    """
    if not folder.exists():
        os.rename(staged, folder)
        return
    aside = Path(tempfile.mkdtemp(prefix=f".{folder.name}.old.", dir=folder.parent))
    os.rename(folder, aside / "old")
    try:
        for path in (aside / "old").iterdir():
            if path.name not in (MANIFEST, ENCODER, POLICY):
                (shutil.copytree if path.is_dir() else shutil.copy2)(path, staged / path.name)
        os.rename(staged, folder)
    except OSError:
        os.rename(aside / "old", folder)
        raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)
