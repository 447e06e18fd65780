"""From trained networks to a bundle: exported, compared with torch, sealed, and put in place in one step."""

import contextlib
import logging
import os
import shutil
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from torch import nn

from contactsafe.core.errors import BundleError, ContactSafeError, OutputError
from contactsafe.core.files import cannot_write, write_whole
from contactsafe.learning.checkpoints import write_json
from contactsafe.learning.encoder import VAE, MaskEncoder
from contactsafe.policy.action_config import ACTION_SIZE, ACTIONS
from contactsafe.policy.bundle import ENCODER, POLICY, Bundle
from contactsafe.policy.manifest import FORMAT, MANIFEST, digest
from contactsafe.policy.observation import ObservationScaling
from contactsafe.policy.perception import open_session

TOLERANCE = 1e-4
"""Largest difference between torch and ONNX Runtime that is accepted.

Single precision rounds to 2e-5 of an action in nets that training has made steep, by another rule on each processor;
a model that was exported wrongly is off by 1e-2 and more.
"""

OPSET = 18


class DeployedPolicy(nn.Module):
    """Raw state and latent to a clipped action: the scaling and the clipping travel inside the graph.

    Args:
        layers: the trained network, scaled observation (N, k) to the mean of the first actions; others are 0.
        scaling: that it was trained with.
    """

    widen: torch.Tensor | None
    centre: torch.Tensor
    scale: torch.Tensor

    def __init__(self, layers: nn.Module, scaling: ObservationScaling):
        super().__init__()
        self.layers = layers
        self.clip = scaling.clip
        self.register_buffer("centre", torch.tensor(scaling.centre, dtype=torch.float32))
        self.register_buffer("scale", torch.tensor(scaling.scale, dtype=torch.float32))
        with torch.no_grad():
            learned = layers(torch.zeros(1, len(scaling.centre))).shape[1]
        self.register_buffer("widen", None if learned == ACTION_SIZE else torch.eye(learned, ACTION_SIZE))

    def forward(self, state: torch.Tensor, latent: torch.Tensor | None = None) -> torch.Tensor:
        """Compute the action, (N, 18) in [-1, 1]."""
        observed = state if latent is None else torch.cat([state, latent], dim=1)
        scaled = (observed - self.centre) / self.scale
        action = self.layers(scaled.clamp(-self.clip, self.clip)).clamp(-1.0, 1.0)
        return action if self.widen is None else action @ self.widen


@contextlib.contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Keep a logger's warnings back: the exporter tells of packages that nothing here asks for."""
    logger = logging.getLogger(name)
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def to_onnx(module: nn.Module, examples: Sequence[torch.Tensor], inputs: Sequence[str], output: str) -> bytes:
    """Export a module with a free batch size, all weights inside, and no trace of the machine it was made on.

    Args:
        module: to export.
        examples: example inputs, one tensor each, batch first.
        inputs: their names.
        output: name of the output.

    Returns:
        The file's bytes.
    """
    batch = torch.export.Dim("n", min=1, max=4096)
    with warnings.catch_warnings(), _quiet("torch.onnx"), tempfile.TemporaryDirectory() as folder:
        warnings.simplefilter("ignore")
        path = Path(folder) / "model.onnx"
        torch.onnx.export(
            module.eval(),
            tuple(examples),
            str(path),
            dynamo=True,
            external_data=False,
            opset_version=OPSET,
            input_names=list(inputs),
            output_names=[output],
            dynamic_shapes=tuple({0: batch} for _ in examples),
            verbose=False,
        )
        model = onnx.load(path)
    return _without_traces(model).SerializeToString()


def _without_traces(model: onnx.ModelProto) -> onnx.ModelProto:
    """Clear what the exporter notes of its own run."""
    # Stack traces and local paths are noted in there; they are nobody's business.
    graph = model.graph
    ports = (*graph.input, *graph.output, *graph.value_info)
    for entry in (model, graph, *graph.node, *graph.initializer, *ports):
        if hasattr(entry, "metadata_props"):
            del entry.metadata_props[:]
        entry.doc_string = ""
    return model


def compare(module: nn.Module, data: bytes, name: str, examples: Sequence[torch.Tensor], inputs: Sequence[str]) -> None:
    """Refuse an exported model that does not compute what the trained one does.

    Raises:
        ContactSafeError: outputs differ by more than TOLERANCE, over the examples.
    """
    session = open_session(data, name)
    found = session.run(None, {k: x.numpy() for k, x in zip(inputs, examples, strict=True)})[0]
    with torch.no_grad():
        wanted = module.eval()(*examples).numpy()
    worst = float(np.abs(found - wanted).max())
    if not worst <= TOLERANCE * max(1.0, float(np.abs(wanted).max())):
        raise ContactSafeError(
            f"{name} differs from the trained network by {worst:.1e}, allowed {TOLERANCE}; not written"
        )


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
        raise OutputError(f"{folder} exists; give --force to replace it, or another folder")
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
