"""Trained networks as ONNX models: exported, cleared of traces of this machine, and compared with torch."""

import contextlib
import logging
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import onnx
import torch
from torch import nn

from contactsafe.core.errors import ContactSafeError
from contactsafe.policy.action_config import ACTION_SIZE
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
